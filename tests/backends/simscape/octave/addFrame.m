function addFrame(body, name, parent, transform)
frames = body("frames");
assert(isfield(frames, parent) && ~isfield(frames, name) && isvarname(name));
frames.(name) = frames.(parent) * transform;
body("frames") = frames;
end
