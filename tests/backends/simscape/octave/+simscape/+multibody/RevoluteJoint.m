function object = RevoluteJoint()
object = struct("class", "RevoluteJoint");
end
