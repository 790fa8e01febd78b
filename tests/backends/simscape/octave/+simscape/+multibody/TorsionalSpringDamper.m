function object = TorsionalSpringDamper()
object = struct("class", "TorsionalSpringDamper");
end
