function distribution = MassDistribution(mass, center, moments, products)
% Products in the order yz zx xy, elements of the tensor.
assert(strcmp(mass.unit, "kg") && strcmp(center.unit, "m"));
assert(strcmp(moments.unit, "kg*m^2") && strcmp(products.unit, "kg*m^2"));
m = moments.si;
p = products.si;
tensor = [m(1) p(3) p(2); p(3) m(2) p(1); p(2) p(1) m(3)];
distribution = struct("class", "Inertia", "mass", mass.si, "center", center.si(:), "tensor", tensor);
end
