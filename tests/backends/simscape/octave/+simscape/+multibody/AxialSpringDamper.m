function object = AxialSpringDamper()
object = struct("class", "AxialSpringDamper");
end
