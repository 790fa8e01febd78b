function connectVia(robot, joint, base, follower)
assert(isfield(robot.Components, joint));
connector(robot, base);
connector(robot, follower);
robot.Connections{end + 1} = {joint, base, follower};
end
