function brick = Brick(v)
assert(strcmp(v.unit, "m"));
brick = struct("class", "Geometry");
end
