// GLSL ES 3.00. One key light from above, sky and floor light, soft shadows from capsules (no shadow maps).

const CAPSULES = 20;

const COMMON = `#version 300 es
precision highp float;
precision highp int;
const vec3 KEY = vec3(0.412, 0.800, 0.436);
uniform vec4 uCapA[${CAPSULES}];
uniform vec4 uCapB[${CAPSULES}];
uniform int uCaps;
// Where a ray passes a capsule: (distance to its surface, distance along the ray).
vec2 pass(vec3 o, vec3 dir, vec3 a, vec3 b, float r) {
  vec3 ab = b - a, ao = o - a;
  float bb = dot(ab, ab), bd = dot(ab, dir), bo = dot(ab, ao), od = dot(ao, dir);
  float t = clamp((bo - od * bd) / max(1e-6, bb - bd * bd), 0.0, 1.0);
  float s = max(1e-4, dot(a + ab * t - o, dir));
  return vec2(length(a + ab * t - o - dir * s) - r, s);
}
float toCapsule(vec3 p, vec3 a, vec3 b) {
  vec3 ab = b - a;
  return length(p - a - ab * clamp(dot(p - a, ab) / max(1e-6, dot(ab, ab)), 0.0, 1.0));
}
// 1 lit to 0 in shadow; capsules within the gap of p count less, so that a surface does not shade itself.
float keyLight(vec3 p, float gap) {
  float lit = 1.0;
  for (int i = 0; i < ${CAPSULES}; i++) {
    if (i >= uCaps) break;
    vec2 hit = pass(p, KEY, uCapA[i].xyz, uCapB[i].xyz, uCapA[i].w);
    float part = smoothstep(-0.6, 0.6, 7.0 * hit.x / hit.y);
    float far = gap > 0.0 ? smoothstep(0.2 * gap, gap, toCapsule(p, uCapA[i].xyz, uCapB[i].xyz) - uCapA[i].w) : 1.0;
    lit *= mix(1.0, part, far * uCapB[i].w);
  }
  return lit;
}
`;

const BODY_VERTEX = (bones) => `#version 300 es
precision highp float;
layout(location = 0) in vec3 aPosition;
layout(location = 1) in vec3 aNormal;
layout(location = 2) in vec4 aBones;
layout(location = 3) in vec4 aWeights;
layout(location = 4) in vec4 aLook;
uniform vec4 uBones[${3 * bones}];
uniform float uShares[${bones}];
uniform mat4 uView;
out vec3 vWorld, vNormal, vRest;
flat out float vTint;
out float vOcclusion;
out vec2 vLook;
out float vShare;
void main() {
  vec4 r0 = vec4(0.0), r1 = vec4(0.0), r2 = vec4(0.0);
  float share = 0.0;
  for (int i = 0; i < 4; i++) {
    int b = 3 * int(aBones[i] + 0.5);
    r0 += aWeights[i] * uBones[b];
    r1 += aWeights[i] * uBones[b + 1];
    r2 += aWeights[i] * uBones[b + 2];
    share += aWeights[i] * uShares[int(aBones[i] + 0.5)];
  }
  vShare = share;
  vec4 p = vec4(aPosition, 1.0);
  vWorld = vec3(dot(r0, p), dot(r1, p), dot(r2, p));
  vNormal = vec3(dot(r0.xyz, aNormal), dot(r1.xyz, aNormal), dot(r2.xyz, aNormal));
  vRest = aPosition;
  vTint = aLook.x * 255.0;
  vOcclusion = aLook.y;
  vLook = 2.0 * aLook.zw - 1.0;
  gl_Position = uView * vec4(vWorld, 1.0);
}`;

const BODY_FRAGMENT = `${COMMON}
in vec3 vWorld, vNormal, vRest;
flat in float vTint;
in float vOcclusion;
in vec2 vLook;
in float vShare;
// Colours of bones that go their own way and of those that follow the user; w: how strongly, 0 for none.
uniform vec4 uOwn;
uniform vec4 uFollows;
uniform vec3 uEye;
uniform vec3 uTints[9];
uniform vec3 uClothes[3];
uniform vec3 uCloth;
uniform vec4 uSleeve;
uniform float uAlpha;
uniform float uShade;
out vec4 colour;
vec3 dressed() {
  float w = 0.004;
  vec3 c = mix(uClothes[1], uClothes[0], smoothstep(-w, w, vRest.y - uCloth.y));
  c = mix(uClothes[2], c, smoothstep(-w, w, vRest.y - uCloth.x));
  float cuff = abs(vRest.x) > uSleeve.w ? abs(vRest.x) * uSleeve.x + vRest.y * uSleeve.y - uSleeve.z : -1.0;
  float skin = max(smoothstep(-w, w, cuff), smoothstep(-w, w, vRest.y - uCloth.z - 0.5 * abs(vRest.x) + 0.3 * vRest.z));
  float hem = min(min(abs(vRest.y - uCloth.y), abs(cuff)), abs(vRest.y - uCloth.x));
  return mix(c, uTints[1], skin) * mix(0.82, 1.0, smoothstep(0.0, 0.007, hem));
}
// White, iris with a dark rim, pupil.
vec3 eyeball() {
  float r = length(vLook), w = max(fwidth(r), 0.01);
  vec3 iris = uTints[7] * mix(1.25, 0.45, smoothstep(0.36, 0.56, r));
  vec3 c = mix(iris, uTints[3], smoothstep(-w, w, r - 0.56));
  return mix(vec3(0.004), c, smoothstep(-w, w, r - 0.25));
}
void main() {
  int tint = int(vTint + 0.5);
  vec3 base = tint == 0 ? dressed() : tint == 3 ? eyeball() : uTints[tint];
  vec3 whom = mix(uOwn.rgb, uFollows.rgb, vShare);
  base = mix(base, whom, tint == 0 ? uOwn.w : tint == 1 ? uFollows.w : 0.0);
  vec3 n = normalize(vNormal), v = normalize(uEye - vWorld);
  if (dot(n, v) < 0.0) n = normalize(n - 1.02 * dot(n, v) * v);
  // The face is nearer to the head's capsule than clothes to theirs.
  float lit = keyLight(vWorld + 0.004 * n, tint == 0 ? 0.07 : 0.16);
  float wrap = clamp((dot(n, KEY) + 0.35) / 1.35, 0.0, 1.0);
  float fill = clamp(dot(n, normalize(vec3(-0.7, 0.15, 0.5))) * 0.5 + 0.5, 0.0, 1.0);
  float sky = 0.5 + 0.5 * n.y;
  float open = vOcclusion * mix(0.62, 1.0, smoothstep(0.0, 0.5, vWorld.y + 0.35 * n.y));
  vec3 light = vec3(1.00, 0.95, 0.88) * (0.92 * wrap * wrap * mix(tint == 1 ? 0.6 : 0.25, 1.0, lit));
  light += open * (mix(vec3(0.24, 0.23, 0.25), vec3(0.46, 0.50, 0.58), sky) * uShade + vec3(0.10, 0.11, 0.15) * fill);
  float rim = pow(1.0 - clamp(dot(n, v), 0.0, 1.0), 3.5);
  vec3 h = normalize(KEY + v);
  float gloss = tint == 3 || tint == 5 ? 0.9 : 0.06;
  float shine = gloss * pow(clamp(dot(n, h), 0.0, 1.0), tint == 3 ? 90.0 : tint == 5 ? 40.0 : 14.0) * lit;
  vec3 c = base * light + shine + rim * open * vec3(0.17, 0.19, 0.24);
  colour = vec4(pow(c, vec3(0.4545)) * uAlpha, uAlpha);
}`;

const FLOOR_VERTEX = `#version 300 es
precision highp float;
layout(location = 0) in vec2 aCorner;
uniform mat4 uView;
uniform vec3 uCentre;
out vec3 vWorld;
void main() {
  vWorld = vec3(uCentre.x + 14.0 * aCorner.x, 0.0, uCentre.z + 14.0 * aCorner.y);
  gl_Position = uView * vec4(vWorld, 1.0);
}`;

const FLOOR_FRAGMENT = `${COMMON}
in vec3 vWorld;
uniform vec3 uCentre;
uniform vec3 uFloor;
uniform vec4 uGrid;
uniform float uDark;
uniform vec3 uRug;
// With a backdrop (1) or a bare grid (0), see-through (1: shadows alone), where the rug lies.
uniform vec4 uScene;
out vec4 colour;
float lines(float period, float width) {
  vec2 g = abs(fract(vWorld.xz / period + 0.5) - 0.5) * period;
  vec2 w = fwidth(vWorld.xz);
  vec2 l = (1.0 - smoothstep(vec2(width), vec2(width) + 1.5 * w, g)) * clamp(width / w + 0.35, 0.0, 1.0);
  return max(l.x, l.y);
}
void main() {
  float fade = 1.0 - smoothstep(2.5, 9.0, length(vWorld.xz - uCentre.xz));
  float near = 1.0 - smoothstep(1.0, 4.5, length(vWorld.xz - uCentre.xz));
  float open = 1.0, lit = 1.0;
  // Shadows reach no further than this.
  int caps = length(vWorld.xz - uCentre.xz) < 3.4 ? uCaps : 0;
  for (int i = 0; i < ${CAPSULES}; i++) {
    if (i >= caps) break;
    vec3 a = uCapA[i].xyz, b = uCapB[i].xyz, ab = b - a;
    float t = clamp(dot(vWorld - a, ab) / max(1e-6, dot(ab, ab)), 0.0, 1.0);
    vec3 d = a + ab * t - vWorld;
    float r = uCapA[i].w, l = length(d);
    // Occlusion of a sphere seen from the floor: cosine over distance squared (form factor).
    open *= 1.0 - uCapB[i].w * clamp(0.85 * (max(d.y, 0.0) / l) * r * r / (l * l), 0.0, 0.8);
  }
  if (caps > 0) lit = keyLight(vWorld, 0.0);
  float shadow = clamp(1.0 - open * mix(0.62, 1.0, lit), 0.0, 1.0);
  float grid = max(lines(1.0, 0.0055), 0.35 * lines(0.25, 0.0025) * near);
  vec4 ground = vec4(uFloor, 1.0) * (0.9 * fade);
  vec4 mark = vec4(uGrid.rgb, 1.0) * (uGrid.a * grid * fade);
  float away = length(vWorld.xz - uScene.zw), soft = fwidth(away) + 0.004;
  float rug = uScene.x * (1.0 - smoothstep(1.9, 1.9 + soft, away));
  float edge = rug * (1.0 - smoothstep(0.012, 0.012 + soft, abs(away - 1.82)));
  mark *= 1.0 - 0.85 * rug;
  ground = mix(ground, vec4(uRug * mix(1.0, 0.86, edge), 1.0), rug);
  ground = mark + ground * (1.0 - mark.a);
  ground *= 1.0 - uScene.y;
  float dark = shadow * uDark * fade;
  colour = vec4(ground.rgb * (1.0 - dark), max(ground.a, dark));
}`;

const LINE_VERTEX = `#version 300 es
precision highp float;
layout(location = 0) in vec3 aPosition;
layout(location = 1) in vec4 aColour;
uniform mat4 uView;
out vec4 vColour;
void main() {
  vColour = aColour;
  gl_Position = uView * vec4(aPosition, 1.0);
}`;

const LINE_FRAGMENT = `#version 300 es
precision mediump float;
in vec4 vColour;
out vec4 colour;
void main() { colour = vec4(vColour.rgb * vColour.a, vColour.a); }`;

const SKY_VERTEX = `#version 300 es
precision highp float;
layout(location = 0) in vec2 aCorner;
uniform mat4 uView;
uniform vec3 uEye;
out vec3 vWay;
void main() {
  float s = gl_InstanceID < 3 ? 1.0 : -1.0;
  int axis = gl_InstanceID % 3;
  vWay = axis == 0 ? vec3(s, aCorner) : axis == 1 ? vec3(aCorner.y, s, aCorner.x) : vec3(aCorner, s);
  gl_Position = uView * vec4(uEye + 20.0 * vWay, 1.0);
}`;

// From the floor's colour at the horizon to the zenith's; noise of half a step hides bands.
const SKY_FRAGMENT = `#version 300 es
precision highp float;
in vec3 vWay;
uniform vec3 uSky[2];
uniform vec3 uFloor;
out vec4 colour;
void main() {
  float up = normalize(vWay).y;
  vec3 c = mix(uSky[0], uSky[1], pow(clamp(up, 0.0, 1.0), 0.6));
  c = mix(c, uFloor, smoothstep(0.02, -0.12, up));
  c += (fract(sin(dot(gl_FragCoord.xy, vec2(12.9898, 78.233))) * 43758.5453) - 0.5) / 255.0;
  colour = vec4(c, 1.0);
}`;
