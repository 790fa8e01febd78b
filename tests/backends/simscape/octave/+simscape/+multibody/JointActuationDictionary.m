function object = JointActuationDictionary()
object = containers.Map("KeyType", "char", "ValueType", "any");
end
