/* Loops over vectors in which a dense solve spends its time.

   A sum has the order of this text, four lanes of partial sums, on every machine: with
   -ffp-contract=off the code for AVX2 and that for any x86-64, between which the loader
   chooses (HOT), give the same bits. */
#include <stddef.h>
#include <string.h>

#if defined(__x86_64__) && defined(__linux__) && defined(__GLIBC__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(NAMLCP_NATIVE) && \
    ((defined(__GNUC__) && !defined(__clang__) && __GNUC__ >= 11))
#define HOT __attribute__((target_clones("arch=x86-64-v3", "default"), noinline, unused)) static
#elif defined(__GNUC__)
#define HOT __attribute__((noinline, unused)) static
#else
#define HOT static
#endif

#if defined(__GNUC__)
typedef double lanes __attribute__((vector_size(32), aligned(8)));
#define ZERO {0}
#define ADD(s, a, b) s += (a) * (b)
#define JOIN(s, t) s += t
#define SUM(s) ((s[0] + s[1]) + (s[2] + s[3]))
#define RESTRICT __restrict__
#else
typedef struct { double v[4]; } lanes;
#define ZERO {{0, 0, 0, 0}}
#define ADD(s, a, b) do { for (int l = 0; l < 4; l++) s.v[l] += a.v[l] * b.v[l]; } while (0)
#define JOIN(s, t) do { for (int l = 0; l < 4; l++) s.v[l] += t.v[l]; } while (0)
#define SUM(s) ((s.v[0] + s.v[1]) + (s.v[2] + s.v[3]))
#define RESTRICT __restrict
#endif
#define GET(name, p) lanes name = *(const lanes *)(p)

HOT double long_dot(const double *a, const double *b, ptrdiff_t n) {
    lanes s = ZERO, t = ZERO;
    ptrdiff_t i = 0;
    for (; i + 8 <= n; i += 8) {
        GET(a0, a + i); GET(b0, b + i); GET(a1, a + i + 4); GET(b1, b + i + 4);
        ADD(s, a0, b0); ADD(t, a1, b1);
    }
    JOIN(s, t);
    if (i + 4 <= n) { GET(a0, a + i); GET(b0, b + i); ADD(s, a0, b0); i += 4; }
    double total = SUM(s);
    for (; i < n; i++) total += a[i] * b[i];
    return total;
}

/* a'b; short vectors, which most are in a small QP, without a call. */
static inline double dot(const double *a, const double *b, ptrdiff_t n) {
    if (n >= 4) return long_dot(a, b, n);
    double total = 0.0;
    for (ptrdiff_t i = 0; i < n; i++) total += a[i] * b[i];
    return total;
}

/* out = (row'a, row'b, row'c, row'd) */
HOT void four_dots(const double *row, const double *a, const double *b, const double *c,
                   const double *d, ptrdiff_t n, double *out) {
    lanes s = ZERO, t = ZERO, u = ZERO, v = ZERO;
    ptrdiff_t i = 0;
    for (; i + 4 <= n; i += 4) {
        GET(x, row + i); GET(p, a + i); GET(q, b + i); GET(r, c + i); GET(w, d + i);
        ADD(s, x, p); ADD(t, x, q); ADD(u, x, r); ADD(v, x, w);
    }
    lanes sums = {SUM(s), SUM(t), SUM(u), SUM(v)};
    for (; i < n; i++) {
        lanes x = {row[i], row[i], row[i], row[i]}, column = {a[i], b[i], c[i], d[i]};
        ADD(sums, x, column);
    }
    *(lanes *)out = sums;
}

/* out += scale a */
HOT void long_add_scaled(double scale, const double *RESTRICT a, double *RESTRICT out, ptrdiff_t n) {
    for (ptrdiff_t i = 0; i < n; i++) out[i] += scale * a[i];
}

static inline void add_scaled(double scale, const double *a, double *out, ptrdiff_t n) {
    if (n >= 8) { long_add_scaled(scale, a, out, n); return; }
    for (ptrdiff_t i = 0; i < n; i++) out[i] += scale * a[i];
}

/* out += fa a + fb b + fc c + fd d */
HOT void add_four(double fa, const double *RESTRICT a, double fb, const double *RESTRICT b,
                  double fc, const double *RESTRICT c, double fd, const double *RESTRICT d,
                  double *RESTRICT out, ptrdiff_t n) {
    for (ptrdiff_t i = 0; i < n; i++)
        out[i] += (fa * a[i] + fb * b[i]) + (fc * c[i] + fd * d[i]);
}

/* out -= fa a + fb b + fc c + fd d, summed from left to right */
HOT void subtract_sum(double fa, const double *RESTRICT a, double fb,
                      const double *RESTRICT b, double fc, const double *RESTRICT c,
                      double fd, const double *RESTRICT d, double *RESTRICT out,
                      ptrdiff_t n) {
    for (ptrdiff_t i = 0; i < n; i++)
        out[i] -= fa * a[i] + fb * b[i] + fc * c[i] + fd * d[i];
}

/* A hash of the bits and places of numbers (mod 2^64): the products of the halves of each,
   mixed, as in XXH3 (Collet, 2019). Vectors of numbers have these. `total`: the hash of
   the arrays before, whose order counts. */
HOT unsigned long long hash_of(const double *values, ptrdiff_t n, unsigned long long total) {
    unsigned long long bits, own = 0, key = 0x9E3779B97F4A7C15ull;
    for (ptrdiff_t i = 0; i < n; i++) {
        memcpy(&bits, values + i, sizeof bits);
        unsigned long long v = bits ^ key;
        v ^= v >> 29;
        own += bits + (v & 0xFFFFFFFFull) * (v >> 32);
        key += 0x9E3779B97F4A7C15ull;
    }
    return own + total * 0xC2B2AE3D27D4EB4Full;
}
