"""Profile compact: an octree of the quantized vertices, its Maps and Diffs coded with adaptive, mixed contexts."""
