// Triangle meshes: what a view sees of them and where they are solid; shared by the CPU and the GPU build.
#include <math.h>
#ifdef __CUDACC__
#define MD __device__ __forceinline__
#define KEY_MIN(p, k) atomicMin(p, k)
#define ADD(p, n) atomicAdd(p, n)
#else
#define MD static inline
#define KEY_MIN(p, k) (*(p) = *(p) < (k) ? *(p) : (k))
#define ADD(p, n) (*(p) += (n))
#endif
typedef unsigned long long key_t64;
#define NO_KEY 0xffffffffffffffffull
// view: azimuth, shift x, shift y (px), scale, elevation; g: centre, pitch. A point becomes column, row and depth (px from the centre)
MD void project(const float* g, const float* v, int H, int W, int up, const float* p, float* o) {
  float s = g[3] / up, ca = cosf(v[0]), sa = sinf(v[0]), ce = cosf(v[4]), se = sinf(v[4]);
  float x = p[0] - g[0], y = p[1] - g[1], z = p[2] - g[2], d = -x * sa + y * ca;
  o[0] = (x * ca + y * sa) / s * v[3] + v[1] + .5f * W;
  o[1] = .5f * H - (z * ce + d * se) / s * v[3] + v[2];
  o[2] = (d * ce - z * se) / s;
}
// nearest triangle of each pixel: lanes of one triangle take every `step`th pixel of its box
MD void raster(const float* g, const float* v, int H, int W, int up, const float* a, const float* b, const float* c, unsigned id, key_t64* keys, int lane, int step) {
  float A[3], B[3], C[3];
  project(g, v, H, W, up, a, A); project(g, v, H, W, up, b, B); project(g, v, H, W, up, c, C);
  float x0 = fmaxf(fminf(A[0], fminf(B[0], C[0])), 0), x1 = fminf(fmaxf(A[0], fmaxf(B[0], C[0])), W);
  float y0 = fmaxf(fminf(A[1], fminf(B[1], C[1])), 0), y1 = fminf(fmaxf(A[1], fmaxf(B[1], C[1])), H);
  int c0 = (int)ceilf(x0 - .5f), c1 = (int)floorf(x1 - .5f), r0 = (int)ceilf(y0 - .5f), r1 = (int)floorf(y1 - .5f);
  if (c0 < 0) c0 = 0; if (r0 < 0) r0 = 0; if (c1 > W - 1) c1 = W - 1; if (r1 > H - 1) r1 = H - 1;
  if (c1 < c0 || r1 < r0) return;
  float area = (B[0] - A[0]) * (C[1] - A[1]) - (B[1] - A[1]) * (C[0] - A[0]);
  if (fabsf(area) < 1e-9f) return;
  float inv = 1 / area; int w = c1 - c0 + 1, n = w * (r1 - r0 + 1);
  for (int i = lane; i < n; i += step) {
    int r = r0 + i / w, q = c0 + i % w; float px = q + .5f, py = r + .5f;
    float k1 = ((px - A[0]) * (C[1] - A[1]) - (py - A[1]) * (C[0] - A[0])) * inv;
    float k2 = ((B[0] - A[0]) * (py - A[1]) - (B[1] - A[1]) * (px - A[0])) * inv;
    if (k1 < -1e-5f || k2 < -1e-5f || k1 + k2 > 1 + 1e-5f) continue;
    float d = A[2] + k1 * (B[2] - A[2]) + k2 * (C[2] - A[2]);
    union { float f; unsigned u; } t; t.f = d + 4096.f;      // positive: its bits are ordered as it is
    KEY_MIN(keys + r * W + q, ((key_t64)t.u << 32) | id);
  }
}
// what a pixel shows, as `ray` of sdf.h says it: depth, normal across and up, code
MD void shown(key_t64 key, const float* g, const float* v, const float* verts, const int* tris, const int* codes, float* out) {
  if (key == NO_KEY) { out[0] = 1e9f; out[1] = out[2] = 0; out[3] = -1; return; }
  unsigned id = (unsigned)key; const int* t = tris + (size_t)id * 3;
  const float *a = verts + (size_t)t[0] * 3, *b = verts + (size_t)t[1] * 3, *c = verts + (size_t)t[2] * 3;
  float e[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, f[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  float n0 = e[1] * f[2] - e[2] * f[1], n1 = e[2] * f[0] - e[0] * f[2], n2 = e[0] * f[1] - e[1] * f[0];
  float l = 1 / (sqrtf(n0 * n0 + n1 * n1 + n2 * n2) + 1e-20f), ca = cosf(v[0]), sa = sinf(v[0]), ce = cosf(v[4]), se = sinf(v[4]);
  float across = (n0 * ca + n1 * sa) * l, away = (-n0 * sa + n1 * ca) * l, high = n2 * l;
  float rise = high * ce + away * se, d = away * ce - high * se;
  if (d > 0) across = -across, rise = -rise;
  union { float f; unsigned u; } k; k.u = (unsigned)(key >> 32);
  out[0] = k.f - 4096.f; out[1] = across; out[2] = rise; out[3] = (float)codes[id];
}
MD double side(const float* a, const float* b, int i, int j, double x, double y) {
  bool swap = a[i] > b[i] || (a[i] == b[i] && a[j] > b[j]);  // an edge shared by two triangles gives them opposite numbers
  const float *p = swap ? b : a, *q = swap ? a : b;
  double e = ((double)q[i] - p[i]) * (y - p[j]) - ((double)q[j] - p[j]) * (x - p[i]);
  return swap ? -e : e;
}
// crossings of the lines through cell centres along `axis` (0 x, 1 y, 2 z downward): signed and plain counts, at the first cell past each
MD void cross(const float* g, const int* dims, const float* a, const float* b, const float* c, int axis, int* sum, int* count, int lane, int step) {
  int nz = dims[0], ny = dims[1], nx = dims[2]; float s = g[3];
  int i = axis == 0 ? 1 : 0, j = axis == 2 ? 1 : 2;
  int n[3] = {nx, ny, nz};
  double area = side(a, b, i, j, c[i], c[j]);
  if (area == 0) return;
  // a hair off the cells' centres: models like whole numbers
  double lo[3] = {g[0] + (.5 - .5 * nx) * s + 1.3e-5, g[1] + (.5 - .5 * ny) * s + 2.9e-5, g[2] + (.5 - .5 * nz) * s + 1.7e-5};
  double u0 = fmin(a[i], fmin(b[i], c[i])), u1 = fmax(a[i], fmax(b[i], c[i])), w0 = fmin(a[j], fmin(b[j], c[j])), w1 = fmax(a[j], fmax(b[j], c[j]));
  int p0 = (int)ceil((u0 - lo[i]) / s), p1 = (int)floor((u1 - lo[i]) / s), q0 = (int)ceil((w0 - lo[j]) / s), q1 = (int)floor((w1 - lo[j]) / s);
  if (p0 < 0) p0 = 0; if (q0 < 0) q0 = 0; if (p1 > n[i] - 1) p1 = n[i] - 1; if (q1 > n[j] - 1) q1 = n[j] - 1;
  if (p1 < p0 || q1 < q0) return;
  int w = p1 - p0 + 1, all = w * (q1 - q0 + 1);
  // the normal's sign along the axis; (i, j, axis) is a left-handed frame for y
  int sign = (area > 0) == (axis != 1) ? -1 : 1;
  for (int t = lane; t < all; t += step) {
    int p = p0 + t % w, q = q0 + t / w; double x = lo[i] + p * (double)s, y = lo[j] + q * (double)s;
    double ea = side(a, b, i, j, x, y), eb = side(b, c, i, j, x, y), ec = side(c, a, i, j, x, y);
    if (!((ea > 0 && eb > 0 && ec > 0) || (ea < 0 && eb < 0 && ec < 0))) continue;
    double z = (eb * a[axis] + ec * b[axis] + ea * c[axis]) / (ea + eb + ec);
    int k = (int)ceil((z - lo[axis]) / s);
    if (k < 0) k = 0; if (k > n[axis]) continue;      // past the last: nothing here is beyond it
    int at[3]; at[i] = p; at[j] = q; at[axis] = k;
    if (k == n[axis]) continue;
    size_t o = ((size_t)(nz - 1 - at[2]) * ny + at[1]) * nx + at[0];
    ADD(sum + o, sign); ADD(count + o, 1);
  }
}
