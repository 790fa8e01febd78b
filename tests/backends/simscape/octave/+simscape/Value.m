function v = Value(number, unit)
% A number in SI; a unit that a robot needs, or an error.
units = struct("name", {"m", "kg", "rad", "deg", "N", "N*m", "m/s", "rad/s", "deg/s", "m/s^2", "rad/s^2", "kg*m^2", ...
    "N*m/rad", "N*m/deg", "N*m/(rad/s)", "N*m/(deg/s)", "N/m", "N/(m/s)"}, ...
    "size", {1, 1, 1, pi/180, 1, 1, 1, 1, pi/180, 1, 1, 1, 1, 180/pi, 1, 180/pi, 1, 1});
at = find(strcmp(unit, {units.name}));
assert(numel(at) == 1, ["no such unit: " unit]);
v = struct("si", number * units(at).size, "unit", unit);
end
