function addComponent(to, name, varargin)
assert(isvarname(name));
if isa(to, "containers.Map")
    [frame, solid] = varargin{:};
    assert(isempty(to("solid")) && strcmp(solid.class, "Solid") && strcmp(frame, "reference"));
    to("solid") = solid.inertia;
else
    assert(~isfield(to.Components, name), ["twice: " name]);
    component = varargin{1};
    if isa(component, "containers.Map")
        % a copy is added: what is changed afterwards does not count
        component = containers.Map(component.keys(), component.values());
    end
    to.Components.(name) = component;
end
end
