function rotation = RotationMatrixRotation(matrix)
assert(norm(matrix' * matrix - eye(3)) < 1e-12 && det(matrix) > 0, "no rotation");
rotation = struct("class", "Rotation", "matrix", matrix);
end
