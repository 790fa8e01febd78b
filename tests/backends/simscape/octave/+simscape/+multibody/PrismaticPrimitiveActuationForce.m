function force = PrismaticPrimitiveActuationForce(v)
force = v;
assert(ischar(v) || strcmp(v.unit, "N"));
end
