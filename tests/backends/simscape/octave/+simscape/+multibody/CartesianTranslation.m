function translation = CartesianTranslation(v)
assert(numel(v.si) == 3 && strcmp(v.unit, "m"));
translation = struct("class", "Translation", "xyz", v.si);
end
