"""Pictures of meshes without a screen: rasterizer, colour scales, lettering, PNG files."""
