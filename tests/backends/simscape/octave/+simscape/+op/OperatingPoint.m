function object = OperatingPoint()
object = containers.Map("KeyType", "char", "ValueType", "any");
end
