// The user's way on the floor as pieces between known positions, thinned to 15 a second.
function trailPieces(d) {
  const pieces = [];
  const known = (i) => !Number.isNaN(d.user[3 * i]);
  const at = (i) => [d.user[3 * i], 0.004, d.user[3 * i + 2]];
  for (let i = 0; i + 2 < d.frames; i += 2) {
    if (known(i) && known(i + 1) && known(i + 2)) pieces.push({ from: at(i), to: at(i + 2), frame: i });
  }
  return pieces;
}

// As lines at a frame: what is past bright and fading over eight seconds, what is to come faint.
function trailLines(d, pieces, frame) {
  return pieces.map(({ from, to, frame: at }) => {
    const past = at <= frame;
    const colour = [...timeColour(at / d.frames), past ? mix(0.28, 0.95, smoothstep(8 * d.fps, 0, frame - at)) : 0.1];
    return { from, to, width: past ? 0.034 : 0.02, c0: colour, c1: colour, flat: true };
  });
}
