function addConnector(body, name)
assert(isfield(body("frames"), name) && ~any(strcmp(name, body("connectors"))));
body("connectors") = [body("connectors") {name}];
end
