function target = Target(v, priority)
assert(any(strcmp(priority, {"High", "Low"})));
target = v;
end
