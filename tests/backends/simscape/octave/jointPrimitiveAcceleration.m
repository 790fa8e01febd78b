function acceleration = jointPrimitiveAcceleration(compiled, path, result)
at = find(strcmp(path, {compiled.links.path}));
assert(numel(at) == 1);
unit = {"m/s^2", "rad/s^2"}{compiled.links(at).turns + 1};
acceleration = simscape.Value(result(at), unit);
end
