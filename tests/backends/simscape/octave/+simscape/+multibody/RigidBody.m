function body = RigidBody()
% A handle: frames, connectors and one solid.
body = containers.Map();
body("class") = "RigidBody";
body("frames") = struct("reference", eye(4));
body("connectors") = {};
body("solid") = [];
end
