function state = computeState(compiled, point)
% Positions and speeds of all joints; each needs its targets.
n = numel(compiled.links);
state = struct("q", zeros(n, 1), "dq", zeros(n, 1));
for k = 1:n
    link = compiled.links(k);
    letters = {{"p", "v"}, {"q", "w"}}{link.turns + 1};
    position = point([link.path "/" letters{1}]);
    speed = point([link.path "/" letters{2}]);
    units = {{"m", "m/s"}, {"rad", "rad/s"}}{link.turns + 1};
    assert(strcmp(position.unit, units{1}) && strcmp(speed.unit, units{2}));
    state.q(k) = position.si;
    state.dq(k) = speed.si;
end
assert(point.Count == 2 * n, "targets of other joints");
end
