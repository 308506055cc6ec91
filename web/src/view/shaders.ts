/**
 * The model's shaders: colours as rendering/shading.py makes them, at each corner the square root of the light on
 * it, times the display colour. Nothing is converted to linear light.
 */

export const MODEL_VERTEX = /* glsl */ `
precision highp float;
invariant gl_Position;
uniform mat4 toCamera;
uniform mat4 toClip;
uniform mat3 normalToCamera;
uniform float bias;
uniform float push; // away from the camera, so that lines on the surface show
in vec3 position;
in vec3 normal;
in vec2 uv;
out vec2 vGains;
out vec2 vUv;

// lights.py's STUDIO, here y up and z backward.
const vec3 KEY = vec3(-0.48, 0.62, 0.62);
const vec3 FILL = vec3(0.80, 0.15, 0.58);

float gain(vec3 n) {
  float light = 0.26 + 0.10 * n.y + 0.72 * max(dot(n, KEY), 0.0) + 0.22 * max(dot(n, FILL), 0.0);
  return sqrt(light);
}

void main() {
  vec3 n = normalToCamera * normal;
  vGains = vec2(gain(n), gain(-n));
  vUv = uv;
  vec4 camera = toCamera * vec4(position, 1.0);
  // Faces that lie on others are drawn over them, as in the rasteriser: a little nearer, in the order to draw.
  vec4 clip = toClip * camera;
  float nearer = 1.0 - bias + push;
  clip.z = (toClip * vec4(camera.xyz * nearer, 1.0)).z / nearer;
  gl_Position = clip;
}
`;

export const MODEL_FRAGMENT = /* glsl */ `
precision highp float;
precision highp sampler2D;
uniform vec4 colour;
uniform float look; // 0: shaded, 1: white
uniform float whole; // 1: covers what is behind it, whatever its opacity
#ifdef TEXTURED
uniform sampler2D map;
#endif
#ifdef CUTOUT
uniform sampler2D holes;
#endif
uniform float fineness; // fragments of a sample along each axis
in vec2 vGains;
in vec2 vUv;
out vec4 result;

void main() {
  vec4 own = colour;
#ifdef CUTOUT
  // As the rasteriser: the nearest texel of the first level that has at most two texels a sample.
  vec2 size = vec2(textureSize(holes, 0));
  vec2 dx = dFdx(vUv) * size;
  vec2 dy = dFdy(vUv) * size;
  float texels = max(abs(dx.x * dy.y - dx.y * dy.x) * fineness * fineness, 1e-12);
  int last = int(floor(log2(max(size.x, size.y)) + 1e-4));
  int level = clamp(int(ceil((log2(texels) - 1.0) / 2.0)), 0, last);
  ivec2 shape = textureSize(holes, level);
  ivec2 at = min(ivec2(fract(vUv) * vec2(shape)), shape - 1);
  if (texelFetch(holes, at, level).r < 0.5) discard;
#endif
#ifdef TEXTURED
  own *= texture(map, vUv);
#endif
  float light = gl_FrontFacing ? vGains.x : vGains.y;
  vec3 shaded = min(own.rgb * light, 1.0);
  result = vec4(mix(shaded, vec3(1.0), look), whole > 0.5 ? 1.0 : own.a);
}
`;

/** Lines of any width: one quad each, of the two ends. */
export const LINE_VERTEX = /* glsl */ `
precision highp float;
uniform mat4 toCamera;
uniform mat4 toClip;
uniform vec2 size; // of the picture in pixels
uniform float width;
in vec2 position; // which end, which side
in vec3 start;
in vec3 end;
out float vSide;
out float vWidth;

void main() {
  vec4 a = toCamera * vec4(start, 1.0);
  vec4 b = toCamera * vec4(end, 1.0);
  // What reaches behind the camera is cut off there.
  const float NEAR = -0.01;
  if (a.z > NEAR && b.z < NEAR) a = mix(a, b, (a.z - NEAR) / (a.z - b.z));
  if (b.z > NEAR && a.z < NEAR) b = mix(b, a, (b.z - NEAR) / (b.z - a.z));
  vec4 p = toClip * a;
  vec4 q = toClip * b;
  vec2 along = (q.xy / q.w - p.xy / p.w) * size;
  float reach = length(along);
  vec2 across = reach > 1e-6 ? vec2(-along.y, along.x) / reach : vec2(0.0);
  vec4 at = position.x < 0.5 ? p : q;
  float wide = width + 1.0;
  at.xy += across * position.y * wide / size * at.w;
  vSide = position.y * wide;
  vWidth = width;
  gl_Position = at;
}
`;

export const LINE_FRAGMENT = /* glsl */ `
precision highp float;
uniform float strength;
in float vSide;
in float vWidth;
out vec4 result;

void main() {
  float cover = clamp(0.5 * vWidth + 0.5 - 0.5 * abs(vSide), 0.0, 1.0);
  result = vec4(1.0, 1.0, 1.0, cover * strength);
}
`;
