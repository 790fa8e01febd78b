function [component, frame] = connector(robot, path)
% Component and frame of "component/frame"; the frame must have a connector.
parts = strsplit(path, "/");
component = parts{1};
frame = parts{2};
body = robot.Components.(component);
if isa(body, "containers.Map")
    assert(any(strcmp(frame, body("connectors"))), ["no connector: " path]);
else
    assert(strcmp(body.class, "WorldFrame") && strcmp(frame, "W"));
end
end
