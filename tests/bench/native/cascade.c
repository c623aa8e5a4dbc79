/* The C floor: a plain orthogonal cascade on levels of equalities, what a prioritized solver cannot avoid doing.

   Level k: Householder LQ of its rows within the columns that are left, W <- W Q, so that the columns behind the level's
   rank are an orthonormal basis of the null space; a row shorter than tolerance * ||A_k||_F counts as dependent; forward
   substitution, or least squares by Householder QR where the level has more rows than rank. In the end x = Q y, of least
   norm. No pivoting, no proof of the rank, no check of the answer: it is there to be compared with, not to be used.

   Rows are padded to whole vectors of eight. A level's reflections meet the rows of later levels four rows at a time, so
   that each row is read once for each level and four sums run side by side.

   Source: Golub and Van Loan 2013, section 5.1; Escande, Mansard and Wieber 2014 (the cascade). */

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LANES = 8 };
typedef double vec __attribute__((vector_size(64)));
typedef long long mask __attribute__((vector_size(64)));

typedef struct {
    vec *W, *V, *y;              /* rows (M, S), reflections (n, S): number j begins in column j; turned answer (S) */
    double *rhs, *scale, *C, *t; /* (M), (n), a tall level's factor by columns, its right-hand side */
} Room;

static inline double sum(vec v) {
    return ((v[0] + v[1]) + (v[2] + v[3])) + ((v[4] + v[5]) + (v[6] + v[7]));
}

/* Keeps lanes at and behind column c; `block` is the vector's place in its row. */
static inline vec from_column(vec w, long block, long c) {
    const mask lane = {0, 1, 2, 3, 4, 5, 6, 7};
    return (vec)((mask)w & (lane + block * LANES >= (mask){c, c, c, c, c, c, c, c}));
}

/* rows (count, S) <- rows (I - s v v^T) for reflections `first` to `last`, in order. */
static inline __attribute__((always_inline)) void reflect(vec *restrict rows, long count, const Room *restrict room,
                                                          long first, long last, const long S) {
    long i = 0;
    for (; i + 4 <= count; i += 4) {
        vec *restrict w0 = rows + i * S, *restrict w1 = w0 + S, *restrict w2 = w1 + S, *restrict w3 = w2 + S;
        for (long j = first; j < last; j++) {
            const vec *restrict v = room->V + j * S;
            const long start = S == 1 ? 0 : j / LANES;
            vec s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0};
            for (long q = start; q < S; q++) {
                s0 += w0[q] * v[q];
                s1 += w1[q] * v[q];
                s2 += w2[q] * v[q];
                s3 += w3[q] * v[q];
            }
            const double d0 = sum(s0) * room->scale[j], d1 = sum(s1) * room->scale[j];
            const double d2 = sum(s2) * room->scale[j], d3 = sum(s3) * room->scale[j];
            for (long q = start; q < S; q++) {
                w0[q] -= d0 * v[q];
                w1[q] -= d1 * v[q];
                w2[q] -= d2 * v[q];
                w3[q] -= d3 * v[q];
            }
        }
    }
    for (; i < count; i++) {
        vec *restrict w = rows + i * S;
        for (long j = first; j < last; j++) {
            const vec *restrict v = room->V + j * S;
            const long start = S == 1 ? 0 : j / LANES;
            vec s = {0};
            for (long q = start; q < S; q++) s += w[q] * v[q];
            const double d = sum(s) * room->scale[j];
            for (long q = start; q < S; q++) w[q] -= d * v[q];
        }
    }
}

/* min ||C y - t||, C (m, r) by columns, of full column rank: y replaces the first r entries of t. */
static void least_squares(long m, long r, double *restrict C, double *restrict t) {
    for (long j = 0; j < r; j++) {
        double *restrict c = C + j * m;
        double s = 0.0;
        for (long i = j; i < m; i++) s += c[i] * c[i];
        const double norm = sqrt(s), alpha = c[j], beta = alpha >= 0.0 ? -norm : norm;
        const double scale = 1.0 / (norm * (norm + fabs(alpha)));
        c[j] = alpha - beta;
        for (long k = j + 1; k <= r; k++) {
            double *restrict o = k < r ? C + k * m : t;
            double d = 0.0;
            for (long i = j; i < m; i++) d += c[i] * o[i];
            d *= scale;
            for (long i = j; i < m; i++) o[i] -= d * c[i];
        }
        c[j] = beta;
    }
    for (long j = r - 1; j >= 0; j--) {
        for (long k = j + 1; k < r; k++) t[j] -= C[k * m + j] * t[k];
        t[j] /= C[j * m + j];
    }
}

static inline __attribute__((always_inline)) void cascade(const Room *restrict room, long M, long n, long p,
                                                          const long *restrict offsets, const double *restrict A,
                                                          const double *restrict b, double tolerance,
                                                          double *restrict x, const long S) {
    vec *restrict W = room->W, *restrict V = room->V, *restrict y = room->y;
    double *restrict entries = (double *)y;
    for (long i = 0; i < M; i++) {
        double *restrict w = (double *)(W + i * S);
        W[i * S + S - 1] = (vec){0};
        for (long j = 0; j < n; j++) w[j] = A[i * n + j];
        room->rhs[i] = b[i];
    }
    for (long q = 0; q < S; q++) y[q] = (vec){0};
    long c = 0;
    for (long k = 0; k < p && c < n; k++) {
        const long r0 = offsets[k], r1 = offsets[k + 1], c0 = c;
        vec length = {0};
        for (long i = r0 * S; i < r1 * S; i++) length += W[i] * W[i];
        /* Columns before c0 keep their share of the norm: turning them changed no row's length. */
        const double floor2 = tolerance * tolerance * sum(length);
        for (long i = r0; i < r1 && c < n; i++) {
            vec *restrict w = W + i * S, *restrict v = V + c * S;
            const long start = S == 1 ? 0 : c / LANES;
            vec s = {0};
            v[start] = from_column(w[start], start, c);
            s += v[start] * v[start];
            for (long q = start + 1; q < S; q++) {
                v[q] = w[q];
                s += v[q] * v[q];
            }
            const double norm2 = sum(s);
            w[start] -= v[start];
            for (long q = start + 1; q < S; q++) w[q] = (vec){0};
            if (!(norm2 > floor2)) continue;
            const double norm = sqrt(norm2), alpha = ((double *)v)[c], beta = alpha >= 0.0 ? -norm : norm;
            ((double *)v)[c] = alpha - beta;
            ((double *)w)[c] = beta;
            room->scale[c] = 1.0 / (norm * (norm + fabs(alpha)));
            reflect(w + S, r1 - i - 1, room, c, c + 1, S);
            c++;
        }
        const long r = c - c0;
        const long blocks = (c + LANES - 1) / LANES;
        if (r == r1 - r0) {
            for (long i = 0; i < r; i++) {
                const vec *restrict w = W + (r0 + i) * S;
                vec s = {0};
                for (long q = 0; q < blocks; q++) s += w[q] * y[q];
                entries[c0 + i] = (room->rhs[r0 + i] - sum(s)) / ((const double *)w)[c0 + i];
            }
        } else if (r) {
            const long m = r1 - r0;
            for (long i = 0; i < m; i++) {
                const vec *restrict w = W + (r0 + i) * S;
                vec s = {0};
                for (long q = 0; q < blocks; q++) s += w[q] * y[q];
                room->t[i] = room->rhs[r0 + i] - sum(s);
                for (long j = 0; j < r; j++) room->C[j * m + i] = ((const double *)w)[c0 + j];
            }
            least_squares(m, r, room->C, room->t);
            for (long j = 0; j < r; j++) entries[c0 + j] = room->t[j];
        }
        if (c < n) reflect(W + r1 * S, M - r1, room, c0, c, S);
    }
    for (long j = c - 1; j >= 0; j--) {
        const vec *restrict v = V + j * S;
        const long start = S == 1 ? 0 : j / LANES;
        vec s = {0};
        for (long q = start; q < S; q++) s += v[q] * y[q];
        const double d = sum(s) * room->scale[j];
        for (long q = start; q < S; q++) y[q] -= d * v[q];
    }
    memcpy(x, entries, n * sizeof(double));
}

static void *aligned(size_t bytes) { return aligned_alloc(64, (bytes + 63) / 64 * 64); }

/* Solves `count` problems of one shape, A (count, M, n), b (count, M), `repeats` times over; fills x (count, n).
   Returns 0, or 1 when there was no memory. */
int cascade_loop(long repeats, long count, long M, long n, long p, const long *offsets, const double *A,
                 const double *b, double tolerance, double *x) {
    const long S = (n + LANES - 1) / LANES;
    Room room = {aligned(M * S * sizeof(vec)), aligned(n * S * sizeof(vec)), aligned(S * sizeof(vec)),
                 aligned(M * sizeof(double)), aligned(n * sizeof(double)), aligned(M * n * sizeof(double)),
                 aligned(M * sizeof(double))};
    const int failed = !(room.W && room.V && room.y && room.rhs && room.scale && room.C && room.t);
    for (long turn = 0; !failed && turn < repeats; turn++)
        for (long i = 0; i < count; i++) {
            const double *a = A + i * M * n, *rhs = b + i * M;
            if (S == 1) cascade(&room, M, n, p, offsets, a, rhs, tolerance, x + i * n, 1);
            else cascade(&room, M, n, p, offsets, a, rhs, tolerance, x + i * n, S);
        }
    free(room.W), free(room.V), free(room.y), free(room.rhs), free(room.scale), free(room.C), free(room.t);
    return failed;
}
