function number = value(v, unit)
% The number of a simscape.Value in a unit.
one = simscape.Value(1, unit);
number = v.si / one.si;
end
