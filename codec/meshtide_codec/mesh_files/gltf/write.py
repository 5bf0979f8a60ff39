"""placeholder"""


def write_gltf(scene, name): ...
