function object = JointAccelerationDictionary()
object = containers.Map("KeyType", "char", "ValueType", "any");
end
