function acceleration = PrismaticPrimitiveAcceleration(v)
assert(strcmp(v.unit, "m/s^2"));
acceleration = v;
end
