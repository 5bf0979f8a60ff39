/** Normals of vertices: the sum of those of their faces, each weighted with its area. */
export function vertexNormals(positions: Float32Array, indices: Uint32Array): Float32Array {
  const normals = new Float32Array(positions.length);
  const at = (array: Float32Array, i: number) => array[i] as number;
  for (let face = 0; face < indices.length; face += 3) {
    const a = 3 * (indices[face] as number);
    const b = 3 * (indices[face + 1] as number);
    const c = 3 * (indices[face + 2] as number);
    const [x, y, z] = [at(positions, a), at(positions, a + 1), at(positions, a + 2)];
    const [ux, uy, uz] = [at(positions, b) - x, at(positions, b + 1) - y, at(positions, b + 2) - z];
    const [vx, vy, vz] = [at(positions, c) - x, at(positions, c + 1) - y, at(positions, c + 2) - z];
    const [nx, ny, nz] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    for (const corner of [a, b, c]) {
      normals[corner] = at(normals, corner) + nx;
      normals[corner + 1] = at(normals, corner + 1) + ny;
      normals[corner + 2] = at(normals, corner + 2) + nz;
    }
  }
  for (let i = 0; i < normals.length; i += 3) {
    const length = Math.hypot(at(normals, i), at(normals, i + 1), at(normals, i + 2));
    if (length > 0) for (let axis = i; axis < i + 3; axis++) normals[axis] = at(normals, axis) / length;
  }
  return normals;
}
