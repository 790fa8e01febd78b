function solid = Solid(geometry, inertia, look)
assert(strcmp(geometry.class, "Geometry") && strcmp(inertia.class, "Inertia") && strcmp(look.class, "VisualProperties"));
solid = struct("class", "Solid", "inertia", inertia);
end
