function acceleration = RevolutePrimitiveAcceleration(v)
assert(strcmp(v.unit, "rad/s^2"));
acceleration = v;
end
