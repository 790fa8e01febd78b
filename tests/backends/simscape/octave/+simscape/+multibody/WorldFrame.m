function object = WorldFrame()
object = struct("class", "WorldFrame");
end
