function object = PrismaticJoint()
object = struct("class", "PrismaticJoint");
end
