function look = SimpleVisualProperties(colour)
assert(numel(colour) == 3);
look = struct("class", "VisualProperties");
end
