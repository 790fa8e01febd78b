classdef Multibody < handle
    properties
        Gravity = struct("si", [0 0 -9.80665], "unit", "m/s^2");
        Components = struct();
        Connections = {};
        Fixed = {};
    end
end
