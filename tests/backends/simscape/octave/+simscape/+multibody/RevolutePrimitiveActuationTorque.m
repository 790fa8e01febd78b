function torque = RevolutePrimitiveActuationTorque(v)
torque = v;
assert(ischar(v) || strcmp(v.unit, "N*m"));
end
