/** The shaders that put photo, model, mask and lines together; colours as annotations/overlay.py has them. */
import type { Display } from "./pose";

export const MODE: Record<Display, number> = {
  blend: 0,
  outline: 1,
  wireframe: 2,
  mask: 3,
  difference: 4,
  photo: 5,
};

/**
 * Along the rows: how far the model (red) and what is not model (green) are, in half steps about the pixels that
 * are covered in part.
 */
export const ALONG = /* glsl */ `
precision highp float;
precision highp sampler2D;
uniform sampler2D layer;
uniform int reach;
uniform vec4 area; // of the picture that holds anything: left, bottom, right, top
out vec4 result;

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec2 nearest = vec2(float(reach) + 1.0);
  for (int d = -reach; d <= reach; d++) {
    float a = texelFetch(layer, ivec2(clamp(at.x + d, int(area.x), int(area.z) - 1), at.y), 0).a;
    float away = abs(float(d));
    if (a > 0.02) nearest.x = min(nearest.x, away + 0.5 - a);
    if (a < 0.98) nearest.y = min(nearest.y, away + a - 0.5);
  }
  result = vec4((nearest + 0.5) / (float(reach) + 2.0), 0.0, 1.0);
}
`;

/** Down the columns of ALONG's result: distance to the outline (red), in pixels over reach + 2. */
export const ACROSS = /* glsl */ `
precision highp float;
precision highp sampler2D;
uniform sampler2D layer;
uniform sampler2D along;
uniform int reach;
uniform vec4 area;
out vec4 result;

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  bool inside = texelFetch(layer, at, 0).a >= 0.5;
  float nearest = float(reach) + 1.0;
  for (int d = -reach; d <= reach; d++) {
    vec2 both = texelFetch(along, ivec2(at.x, clamp(at.y + d, int(area.y), int(area.w) - 1)), 0).rg * (float(reach) + 2.0) - 0.5;
    float own = inside ? both.y : both.x;
    float away = abs(float(d));
    nearest = min(nearest, own <= 0.5 ? away + own : length(vec2(away, own)));
  }
  result = vec4(max(nearest, 0.0) / (float(reach) + 2.0), 0.0, 0.0, 1.0);
}
`;

export const COMPOSITE = /* glsl */ `
precision highp float;
precision highp sampler2D;
uniform sampler2D photo;
uniform bool hasPhoto;
uniform sampler2D layer;
uniform sampler2D lines;
uniform sampler2D outline;
uniform sampler2D mask;
uniform bool hasMask;
uniform bool hasModel;
uniform int mode;
uniform float opacity;
uniform vec3 tint;
uniform float reach;
uniform vec2 outlineWidths; // half of the line, and of its dark rim
uniform vec2 size; // of the canvas in its pixels
uniform vec4 place; // of the photo on it: left, top, width, height
uniform vec4 area; // of the canvas that the model's pictures hold: left, bottom, right, top
uniform float texel; // canvas pixels of one pixel of the photo's picture
out vec4 result;

// Of Okabe and Ito's colours, which colour-blind people tell apart; both also differ from white in lightness.
const vec3 ONLY_MASK = vec3(0.0, 0.447, 0.698);
const vec3 ONLY_MODEL = vec3(0.902, 0.624, 0.0);
const vec3 BOTH = vec3(0.96, 0.96, 0.94);

void main() {
  vec2 at = vec2(gl_FragCoord.x, size.y - gl_FragCoord.y);
  vec2 uv = (at - place.xy) / place.zw;
  bool within = all(greaterThanEqual(uv, vec2(0.0))) && all(lessThan(uv, vec2(1.0)));
  vec3 seen = vec3(0.5);
  if (hasPhoto && within) {
    // Enlarged a lot, pixels are shown as they are.
    vec2 cells = vec2(textureSize(photo, 0));
    vec2 middle = (floor(uv * cells) + 0.5) / cells;
    seen = textureLod(photo, middle, 0.0).rgb;
    if (texel < 6.0) seen = texture(photo, uv).rgb;
  }
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  bool near = hasModel && all(greaterThanEqual(gl_FragCoord.xy, area.xy)) && all(lessThan(gl_FragCoord.xy, area.zw));
  vec4 model = near ? texelFetch(layer, pixel, 0) : vec4(0.0);
  float a = model.a;
  vec3 own = a > 0.0 ? model.rgb / a : vec3(0.0);
  vec3 shown = seen;
  float rim = 0.0;

  if (mode == 0) {
    shown = mix(seen, 0.85 * own + 0.15 * tint, opacity * a);
    rim = min(1.0, opacity / 0.3);
  } else if (mode == 1) {
    rim = 1.0;
  } else if (mode == 3) {
    float grey = dot(seen, vec3(0.299, 0.587, 0.114));
    bool marked = hasMask && within && texture(mask, uv).r >= 0.5;
    bool drawn = a >= 0.5;
    shown = vec3(0.1 + 0.45 * grey);
    vec3 colour = marked ? (drawn ? BOTH : ONLY_MASK) : ONLY_MODEL;
    if (marked || drawn) shown = mix(vec3(grey), colour, 0.72);
  } else if (mode == 4) {
    float grey = dot(seen, vec3(0.299, 0.587, 0.114));
    shown = mix(vec3(0.1 + 0.3 * grey), 0.5 + 0.5 * (seen - own), a);
  }
  if (near && (mode == 1 || mode == 2)) {
    float line = texelFetch(lines, pixel, 0).a;
    // A dark rim keeps lines apart from a photo of their own colour.
    vec3 colour = mode == 1 ? mix(tint, vec3(1.0), 0.55) : tint;
    shown = mix(shown * (1.0 - 0.35 * line), colour, line);
  }
  if (near && rim > 0.0) {
    float away = texelFetch(outline, pixel, 0).r * (reach + 2.0);
    shown *= 1.0 - 0.45 * rim * clamp(outlineWidths.y + 0.5 - away, 0.0, 1.0);
    shown = mix(shown, tint, rim * clamp(outlineWidths.x + 0.5 - away, 0.0, 1.0));
  }
  if (within) {
    result = vec4(shown, 1.0);
  } else {
    // Beyond the photo the model is told only faintly.
    float left = mode == 5 || !near ? 0.0 : 0.35 * a;
    result = vec4(mix(own, tint, 0.3) * left, left);
  }
}
`;
