// Joints: marks at pivots and along axes, lines from bodies to them, and a camera that goes along. Comes after painter.js.

const HALF_BAR = 9, DOT = 3; // pixels

function carried(side, vector, poses, point) { // what a side carries, in the world; without a body it is there already
  if (side.body < 0) return vector;
  const turned = turn(poses[side.body].q, vector);
  return point ? sum(poses[side.body].p, turned, 1) : turned;
}

function drawBones(painter, data, poses) { // where bodies have no surface, these show how they hang together
  for (const joint of data.joints) {
    for (const side of joint.sides.filter((s) => s.body >= 0)) {
      const pose = poses[side.body], { colour, solids } = data.bodies[side.body];
      const beside = solids.filter((s) => Math.hypot(...s.centre) > s.radius).map((s) => s.centre);
      for (const end of [side.point, ...beside]) painter.line([pose.p, carried(side, end, poses, true)], colour, 3);
    }
  }
}

function drawPivots(painter, data, poses) { // over all, so that none is hidden
  const pen = painter.pen;
  for (const joint of data.joints) {
    const place = carried(joint.sides[0], joint.sides[0].point, poses, true), [x, y] = painter.place(place);
    for (const [side, axis] of joint.axes) {
      const along = carried(joint.sides[side], axis, poses, false), half = HALF_BAR / painter.scale;
      painter.line([sum(place, along, -half), sum(place, along, half)], DARK, 1.5, 0.9);
    }
    pen.beginPath();
    if (joint.square) pen.rect(x - DOT, y - DOT, 2 * DOT, 2 * DOT); else pen.arc(x, y, DOT, 0, 2 * Math.PI);
    pen.fillStyle = "#ffffff";
    pen.fill();
    pen.strokeStyle = DARK;
    pen.lineWidth = 1.2;
    pen.stroke();
  }
}

function alongside(follow, poses) { // what must be seen when the camera goes with bodies: always the same size around them
  const middle = [0, 1].map((k) => follow.bodies.reduce((s, b) => s + poses[b].p[k], 0) / follow.bodies.length);
  return [{ point: [...middle, follow.height], radius: follow.radius }];
}
