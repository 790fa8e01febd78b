function result = computeDynamics(compiled, state, actuation, imposed)
% Accelerations of all joints; those that are imposed must have a computed actuation.
links = compiled.links;
n = numel(links);
torque = zeros(n, 1);
ddq = zeros(n, 1);
free = true(n, 1);
for k = 1:n
    spring = links(k).spring;
    torque(k) = -spring(1) * (state.q(k) - spring(3)) - spring(2) * state.dq(k);
    path = links(k).path;
    if imposed.isKey(path)
        assert(ischar(actuation(path)) && strcmp(actuation(path), "Computed"), ["overdetermined: " path]);
        free(k) = false;
        ddq(k) = imposed(path).si;
    elseif actuation.isKey(path)
        torque(k) = torque(k) + actuation(path).si;
    end
end
[matrix, bias] = equations(links, compiled.gravity, state.q, state.dq);
rest = torque - bias - matrix * (ddq .* ~free);
ddq(free) = matrix(free, free) \ rest(free);
result = ddq;
end

function [matrix, bias] = equations(links, gravity, q, dq)
n = numel(links);
matrix = zeros(n);
bias = zeros(n, 1);
poses = cell(n + 1, 1);
linear = cell(n + 1, 1);
turning = cell(n + 1, 1);
w = zeros(3, n + 1);
dw = zeros(3, n + 1);
a = zeros(3, n + 1);
poses{1} = eye(4);
chain = cell(n + 1, 1);
chain{1} = [];
axes = zeros(3, n);
points = zeros(3, n);
for k = 1:n
    p = links(k).parent + 1;
    seat = poses{p} * links(k).seat;
    z = seat(1:3, 3);
    arm = seat(1:3, 4) - poses{p}(1:3, 4);
    a(:, k + 1) = a(:, p) + cross(dw(:, p), arm) + cross(w(:, p), cross(w(:, p), arm));
    step = eye(4);
    if links(k).turns
        step(1:2, 1:2) = [cos(q(k)) -sin(q(k)); sin(q(k)) cos(q(k))];
        w(:, k + 1) = w(:, p) + z * dq(k);
        dw(:, k + 1) = dw(:, p) + cross(w(:, p), z * dq(k));
    else
        step(3, 4) = q(k);
        w(:, k + 1) = w(:, p);
        dw(:, k + 1) = dw(:, p);
        slid = z * q(k);
        a(:, k + 1) = a(:, k + 1) + cross(dw(:, p), slid) + cross(w(:, p), cross(w(:, p), slid)) ...
            + 2 * cross(w(:, p), z * dq(k));
    end
    moved = seat * step;
    poses{k + 1} = moved * links(k).back;
    grip = poses{k + 1}(1:3, 4) - moved(1:3, 4);
    a(:, k + 1) = a(:, k + 1) + cross(dw(:, k + 1), grip) + cross(w(:, k + 1), cross(w(:, k + 1), grip));
    axes(:, k) = z;
    points(:, k) = seat(1:3, 4);
    chain{k + 1} = [chain{p} k];
    rotation = poses{k + 1}(1:3, 1:3);
    out = rotation * links(k).center;
    center = poses{k + 1}(1:3, 4) + out;
    faster = a(:, k + 1) + cross(dw(:, k + 1), out) + cross(w(:, k + 1), cross(w(:, k + 1), out));
    jv = zeros(3, n);
    jw = zeros(3, n);
    for j = chain{k + 1}
        if links(j).turns
            jw(:, j) = axes(:, j);
            jv(:, j) = cross(axes(:, j), center - points(:, j));
        else
            jv(:, j) = axes(:, j);
        end
    end
    tensor = rotation * links(k).tensor * rotation';
    matrix = matrix + links(k).mass * (jv' * jv) + jw' * tensor * jw;
    bias = bias + links(k).mass * jv' * (faster - gravity) ...
        + jw' * (tensor * dw(:, k + 1) + cross(w(:, k + 1), tensor * w(:, k + 1)));
end
end
