function transform = RigidTransform(rotation, translation)
assert(strcmp(rotation.class, "Rotation") && strcmp(translation.class, "Translation"));
transform = [rotation.matrix, translation.xyz(:); 0 0 0 1];
end
