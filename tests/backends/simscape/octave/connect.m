function connect(robot, one, other)
connector(robot, one);
connector(robot, other);
robot.Fixed{end + 1} = {one, other};
end
