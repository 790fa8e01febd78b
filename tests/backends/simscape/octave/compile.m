function compiled = compile(robot)
% Links from the base outwards: parents, frames, solids, springs.
assert(numel(robot.Fixed) == 1 && strcmp(robot.Fixed{1}{1}, "world/W") && strcmp(robot.Fixed{1}{2}, "base/reference"));
bodies = {"base"};
compiled = struct("gravity", robot.Gravity.si(:), "links", struct([]));
for k = 1:numel(robot.Connections)
    [name, base, follower] = robot.Connections{k}{:};
    [parent, seat] = connector(robot, base);
    [child, grip] = connector(robot, follower);
    at = find(strcmp(parent, bodies));
    assert(numel(at) == 1 && ~any(strcmp(child, bodies)), ["no chain at " name]);
    bodies{end + 1} = child;
    joint = robot.Components.(name);
    turns = strcmp(joint.class, "RevoluteJoint");
    primitive = {"Pz", "Rz"}{turns + 1};
    spring = [0 0 0];
    if isfield(joint, primitive)
        law = joint.(primitive).ForceLaws;
        assert(strcmp(law.class, {"AxialSpringDamper", "TorsionalSpringDamper"}{turns + 1}));
        spring = [law.SpringStiffness.si law.DampingCoefficient.si law.EquilibriumPosition.si];
    end
    frames = robot.Components.(parent)("frames");
    own = robot.Components.(child)("frames");
    solid = robot.Components.(child)("solid");
    link = struct("path", [name "/" primitive], "turns", turns, "parent", at - 1, "seat", frames.(seat), ...
        "back", inv(own.(grip)), "mass", solid.mass, "center", solid.center, "tensor", solid.tensor, "spring", spring);
    compiled.links = [compiled.links link];
end
end
