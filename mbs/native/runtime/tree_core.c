/* Inverse and direct dynamics of open trees, and their derivatives; see tree_core.h.
 *
 * All vectors are expressed in the axes of the base. Wrenches, inertias and velocities of a link
 * are about its own origin, which avoids cancellation far away from the base. Products of pairs of
 * joints are about a common point: the origin of the first link of their tree. Velocities are then
 * relative to this point.
 *
 * Recursions over the links run node by node. All other loops run in SIMD lanes over nodes. The
 * columns of a linear system are solved in lanes, one column per lane.
 *
 * Terms: "the link before" is the parent link. "All behind a node" is the subtree of the node: the
 * bodies that the motion of the node moves.
 *
 * Source: Khalil & Creusot 1997 (Newton and Euler); Walker & Orin 1982 (composite bodies);
 * Featherstone 1983 (articulated bodies); Singh, Russell & Wensing 2022 (derivatives of the
 * efforts); Carpentier & Mansard 2018 (derivatives of the accelerations). */
#include "tree_core.h"

#include <math.h>
#include <string.h>

#include "lanes.h"

typedef mbs_lanes V;
typedef double U __attribute__((vector_size(8 * MBS_LANES), may_alias, aligned(8)));
typedef struct {
    V x, y, z;
} V3;
typedef struct {
    double x, y, z;
} D3;

#define INLINE static inline __attribute__((always_inline, unused))

/* Operations on vectors of three elements: SIMD vectors (V3) and scalars (D3). */
#define OPERATIONS(T, S)                                                                         \
    INLINE T plus##T(T a, T b) { return (T){a.x + b.x, a.y + b.y, a.z + b.z}; }                  \
    INLINE T minus##T(T a, T b) { return (T){a.x - b.x, a.y - b.y, a.z - b.z}; }                 \
    INLINE T times##T(S s, T a) { return (T){s * a.x, s * a.y, s * a.z}; }                       \
    INLINE T more##T(T a, S s, T b) { return (T){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z}; } \
    INLINE S dot##T(T a, T b) { return a.x * b.x + a.y * b.y + a.z * b.z; }                      \
    INLINE T cross##T(T a, T b) {                                                                \
        return (T){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};         \
    }                                                                                            \
    INLINE T plus_cross##T(T c, T a, T b) { /* c + a x b */                                      \
        return (T){c.x + a.y * b.z - a.z * b.y, c.y + a.z * b.x - a.x * b.z,                     \
                   c.z + a.x * b.y - a.y * b.x};                                                 \
    }                                                                                            \
    INLINE T combine##T(T a, S x, T b, S y, T c, S z) { /* a x + b y + c z */                    \
        return (T){a.x * x + b.x * y + c.x * z, a.y * x + b.y * y + c.y * z,                     \
                   a.z * x + b.z * y + c.z * z};                                                 \
    }
OPERATIONS(V3, V)
OPERATIONS(D3, double)
#define OF(f, a) _Generic((a), V3: f##V3, D3: f##D3)
#define plus(a, b) OF(plus, a)(a, b)
#define minus(a, b) OF(minus, a)(a, b)
#define times(s, a) OF(times, a)(s, a)
#define more(a, s, b) OF(more, a)(a, s, b)
#define dot(a, b) OF(dot, a)(a, b)
#define cross(a, b) OF(cross, a)(a, b)
#define plus_cross(c, a, b) OF(plus_cross, a)(c, a, b)
#define combine(a, x, b, y, c, z) OF(combine, a)(a, x, b, y, c, z)

/* Rows of the work space, for each node. Vectors are in the axes of the base, except E and T. */
enum {
    X,             /* position of a joint with a single velocity */
    QD,            /* velocity */
    QDD,           /* acceleration */
    E,             /* 9: axes of the link in the axes of the parent link, by columns */
    T = E + 9,     /* 3: origin of the link in the frame of the parent link */
    R = T + 3,     /* 9: axes of the link */
    D = R + 9,     /* 3: vector from the origin of the parent link to the origin of the link */
    P = D + 3,     /* 3: vector from the origin of the first link of the tree to the origin */
    SL = P + 3,    /* 3: linear velocity of the origin for a unit velocity of the node */
    SA = SL + 3,   /* 3: angular velocity for a unit velocity of the node */
    W = SA + 3,    /* 3: angular velocity of the link */
    WL = W + 3,    /* 3: angular velocity of the parent link */
    WD = WL + 3,   /* 3: angular acceleration of the link */
    WDL = WD + 3,  /* 3: angular acceleration of the parent link */
    VD = WDL + 3,  /* 3: acceleration of the origin of the link, minus gravity */
    VDL = VD + 3,  /* 3: acceleration of the origin of the parent link, minus gravity */
    HB = VDL + 3,  /* 3: first moments of the body */
    JB = HB + 3,   /* 6: inertia of the body */
    F = JB + 6,    /* 3: force on the body, then on the subtree of the node */
    M = F + 3,     /* 3: moment on the body, then on the subtree */
    CM = M + 3,    /* mass of the subtree */
    CH = CM + 1,   /* 3: first moments of the subtree */
    CJ = CH + 3,   /* 6: inertia of the subtree */
    N2 = CJ + 6,   /* 3: twice the momentum of the subtree */
    K = N2 + 3,    /* 9: moment on the subtree per added angular velocity, by columns */
    VO = K + 9,    /* 3: velocity of the origin minus the velocity of the common point */
    VL = VO + 3,   /* 3: the same for the point of the parent link that is at the origin */
    FL = VL + 3,   /* 3: momentum of the subtree for a unit velocity of the node */
    FA = FL + 3,   /* 3: its angular momentum, about the common point */
    GA = FA + 3,   /* 3: effort of the node per added angular velocity of the subtree */
    SC = GA + 3,   /* 3: linear velocity at the common point for a unit velocity of the node */
    YA = SC + 3,   /* 3: rate of SA */
    Y2L = YA + 3,  /* 3: second rate of the unit velocity (linear), at the common point */
    Y2A = Y2L + 3, /* 3: second rate of the unit velocity (angular) */
    YSL = Y2A + 3, /* 3: sum of its rates with the parent link and with the link (linear) */
    YSA = YSL + 3, /* 3: sum of its rates with the parent link and with the link (angular) */
    DQL = YSA + 3, /* 3: derivative of the force with respect to the position of the node */
    DQA = DQL + 3, /* 3: derivative of the moment with respect to the position of the node */
    DVL = DQA + 3, /* 3: derivative of the force with respect to the velocity of the node */
    DVA = DVL + 3, /* 3: derivative of the moment with respect to the velocity of the node */
    GB = DVA + 3,  /* 3: angular momentum of the rotor for a unit velocity of the joint */
    TAU = GB + 3,  /* effort, or inertia that the node moves (see `momenta`) */
    MBS_WORK_ROWS
};

typedef struct {
    const mbs_tree *m;
    int n;
    double *w;           /* rows of the work space, accessed by CELL */
    struct chain *nodes; /* state of the recursion over the links: base, then each node */
    double *record;      /* factors of the inertia matrix: 16 for each node */
    V *lanes;            /* 14 groups of eight doubles for each node */
    double *column;      /* scratch column: right-hand side, or unused output */
    double *square;      /* scratch matrix size x size, used if v is not in the order of the tree */
} work;

_Static_assert(MBS_WORK_ROWS < 144, "MBS_TREE_WORK counts 143 rows and a column");

static work space_of(const mbs_tree *m, double *w) {
    work k = {m, m->size, mbs_aligned(w), 0, 0, 0, 0, 0};
    const size_t whole = ((size_t)k.n + 7) / 8 * 8; /* MBS_TREE_WORK is the sum of all these */
    k.nodes = (struct chain *)(k.w + whole * MBS_WORK_ROWS);
    k.record = k.w + whole * (MBS_WORK_ROWS + 32) + 32;
    k.lanes = (V *)(k.record + 16 * (size_t)k.n);
    k.column = (double *)k.lanes + 14 * 8 * (size_t)k.n;
    k.square = k.column + whole;
    return k;
}

/* Access to the work space and to the table, by SIMD vectors and by scalars. Blocks of eight nodes
 * are stored row by row. */
INLINE size_t start_of(int node, size_t rows) {
    return ((size_t)node >> 3) * (8 * rows) + ((size_t)node & 7);
}
#define CELL(row, node) k.w[start_of(node, MBS_WORK_ROWS) + 8 * (row)]
#define FACT(row, node) k.m->numbers[start_of(node, MBS_ROWS) + 8 * (row)]
INLINE V lane(const double *x) { return *(const V *)x; }
INLINE V3 lane3(const double *x) { return (V3){lane(x), lane(x + 8), lane(x + 16)}; }
INLINE void put_lane3(double *x, size_t s, V3 a) {
    *(V *)x = a.x;
    *(V *)(x + s) = a.y;
    *(V *)(x + 2 * s) = a.z;
}
INLINE D3 one3(const double *x) { return (D3){x[0], x[8], x[16]}; }
INLINE void put_one3(double *x, size_t s, D3 a) {
    x[0] = a.x;
    x[s] = a.y;
    x[2 * s] = a.z;
}
#define L1(row) lane(&CELL(row, j))
#define L3(row) lane3(&CELL(row, j))
#define PUT1(row, value) (*(V *)&CELL(row, j) = (value))
#define PUT3(row, value) put_lane3(&CELL(row, j), 8, value)
#define TL1(row) lane(&FACT(row, j))
#define TL3(row) lane3(&FACT(row, j))
#define O3(row, node) one3(&CELL(row, node))
#define T3(row, node) one3(&FACT(row, node))
#define PUT_O3(row, node, value) put_one3(&CELL(row, node), 8, value)
#define EVERY_LANE for (int j = 0; j < k.n; j += MBS_LANES)

/* Set a row to zero in the unused lanes after the last node; node by node loops do not write it. */
static void clear_ends(work k, int row, int rows) {
    for (int j = k.n; j % 8; ++j)
        for (int r = row; r < row + rows; ++r) CELL(r, j) = 0;
}

/* Poses of joints of several velocities (spherical, free) in the parent link. */
static void several(work k, const double *q) {
    const int *joint = k.m->joints;
    for (int c = 0; c < k.m->many; ++c, joint += 3) {
        const int first = joint[0], count = joint[1], last = first + count - 1;
        const double *at = q + joint[2] + (count == 6 ? 3 : 0);
        const double unit = 1 / sqrt(at[0] * at[0] + at[1] * at[1] + at[2] * at[2] + at[3] * at[3]);
        const double w = at[0] * unit, x = at[1] * unit, y = at[2] * unit, z = at[3] * unit;
        const D3 Q[3] = {{w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y)},
                         {2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x)},
                         {2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z}};
        D3 C[3], t = T3(MBS_T, last);
        for (int a = 0; a < 3; ++a) C[a] = T3(MBS_C + 3 * a, last);
        if (count == 6)
            t = plus(t, combine(C[0], q[joint[2]], C[1], q[joint[2] + 1], C[2], q[joint[2] + 2]));
        for (int node = first; node <= last; ++node) {
            for (int a = 0; a < 3; ++a)
                PUT_O3(E + 3 * a, node, combine(C[0], Q[a].x, C[1], Q[a].y, C[2], Q[a].z));
            PUT_O3(T, node, t);
        }
    }
}

/* Vectors of the recursion over the links have four elements; the fourth is zero. */
typedef double Q __attribute__((vector_size(32), may_alias));
INLINE Q turn_round(Q a) { return (Q){a[1], a[2], a[0], a[3]}; }
INLINE Q crossed(Q a, Q b) { return turn_round(a * turn_round(b) - turn_round(a) * b); }

/* State of a link in the recursion. The first element of an array is the base, then each node. */
struct chain {
    Q r0, r1, r2; /* axes of the link */
    Q w, wd, vd;  /* motion of the link: see rows W, WD and VD */
    Q d, vo;      /* see rows D and VO */
};
typedef struct chain chain;

/* Poses of all links. If `moves` is 1, also their velocities and accelerations. */
INLINE void from_link_to_link(work k, int moves) {
    const mbs_tree *m = k.m;
    const double *g = m->gravity;
    chain *const nodes = k.nodes;
    const Q zero = {0, 0, 0, 0};
    nodes[0] = (chain){
        {1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, zero, zero, {-g[0], -g[1], -g[2], 0}, zero, zero};
    Q r0 = zero, r1 = zero, r2 = zero, d = zero, w = zero, wd = zero, vd = zero, vo = zero;
    Q wl = zero, angular = zero, linear = zero; /* parent link; motion of the joint so far */
    int held = -2;
    for (int j = 0; j < k.n; held = j++) {
        const int b = m->before[j], kind = m->kind[j];
        if (m->link[j] == b) {
            if (b != held) {
                const chain *before = nodes + 1 + b;
                r0 = before->r0, r1 = before->r1, r2 = before->r2;
                if (moves) w = before->w, wd = before->wd, vd = before->vd, vo = before->vo;
            }
            const Q c0 = r0, c1 = r1, c2 = r2;
            d = c0 * CELL(T, j) + c1 * CELL(T + 1, j) + c2 * CELL(T + 2, j);
            r0 = c0 * CELL(E, j) + c1 * CELL(E + 1, j) + c2 * CELL(E + 2, j);
            r1 = c0 * CELL(E + 3, j) + c1 * CELL(E + 4, j) + c2 * CELL(E + 5, j);
            r2 = c0 * CELL(E + 6, j) + c1 * CELL(E + 7, j) + c2 * CELL(E + 8, j);
            if (moves) {
                const Q swing = crossed(w, d);
                wl = w, angular = zero, linear = zero;
                vd += crossed(wd, d) + crossed(w, swing);
                vo += swing;
                if (b < 0) vo = zero;
            }
        }
        chain *const node = nodes + 1 + j;
        node->r0 = r0, node->r1 = r1, node->r2 = r2, node->d = d;
        if (!moves) continue;
        const double v = CELL(QD, j), a = CELL(QDD, j);
        if (kind == MBS_REVOLUTE) {
            const Q s = r2 * v;
            wd += r2 * a + crossed(wl, s);
            w += s;
        } else {
            const int h = kind == MBS_PRISMATIC ? 2 : (kind - MBS_SEVERAL) % 3;
            const Q axis = h == 0 ? r0 : h == 1 ? r1 : r2, s = axis * v;
            if (kind == MBS_PRISMATIC || kind >= MBS_SEVERAL + 3) {
                vd += axis * a + 2 * crossed(wl, s);
                linear += s;
                if (m->link[j] >= 0) vo += s;
            } else {
                wd += axis * a + crossed(wl, s);
                w += s;
                angular += s;
                /* the linear velocities of a free joint are along axes that its rotation turns */
                if (h == 2) vd += crossed(angular, linear);
            }
        }
        node->w = w, node->wd = wd, node->vd = vd, node->vo = vo;
    }
}

static void poses_alone(work k) { from_link_to_link(k, 0); }
static void poses_and_motions(work k) { from_link_to_link(k, 1); }

/* Store two vectors of the node of each lane to the rows `row` and `other`. */
INLINE void to_rows(work k, int j, const double *const *from, int at, int row, int other) {
#if defined(MBS_PAIR) && MBS_LANES == 8
    V square[8];
    MBS_UNROLLED
    for (int l = 0; l < 8; ++l) square[l] = lane(from[l] + at);
    mbs_transpose(square);
    MBS_UNROLLED
    for (int r = 0; r < 3; ++r) PUT1(row + r, square[r]);
    MBS_UNROLLED
    for (int r = 0; r < 3; ++r) PUT1(other + r, square[4 + r]);
#else
    for (int l = 0; l < MBS_LANES; ++l)
        for (int r = 0; r < 3; ++r) {
            CELL(row + r, j + l) = from[l][at + r];
            CELL(other + r, j + l) = from[l][at + 4 + r];
        }
#endif
}

/* Store the poses of all links to rows, and their motions if `moves` is 1. All nodes of a joint
 * have the motion of its last node. Also store the unit velocities of all nodes. */
INLINE void in_lanes(work k, int moves) {
    const mbs_tree *m = k.m;
    for (int j = k.n; j % MBS_LANES; ++j) k.nodes[1 + j] = k.nodes[0];
    EVERY_LANE {
        const double *from[MBS_LANES];
        for (int l = 0; l < MBS_LANES; ++l)
            from[l] = (const double *)(k.nodes + 1 + (j + l < k.n ? m->last[j + l] : j + l));
        to_rows(k, j, from, 0, R, R + 3);
        to_rows(k, j, from, 8, R + 6, W);
        if (moves) to_rows(k, j, from, 16, WD, VD);
        const V3 z = L3(R + 6);
        PUT3(SL, times(TL1(MBS_SLIDE), z));
        PUT3(SA, times(TL1(MBS_TURN), z));
    }
    const int *joint = m->joints;
    for (int c = 0; c < m->many; ++c, joint += 3)
        for (int h = 0; h < joint[1]; ++h) {
            const int node = joint[0] + h;
            const D3 axis = O3(R + 3 * (h % 3), node), zero = {0, 0, 0};
            const int slides = joint[1] == 6 && h < 3;
            PUT_O3(SL, node, slides ? axis : zero);
            PUT_O3(SA, node, slides ? zero : axis);
        }
}

/* Copy a column in the order of v to a row. A null pointer is a column of zeros. */
INLINE void gather(work k, int row, const double *from) {
    int j = 0;
    if (k.m->in_order && from)
        for (; j + MBS_LANES <= k.n; j += MBS_LANES) PUT1(row, (V)(*(const U *)(from + j)));
    for (; j < k.n; ++j) CELL(row, j) = from ? from[k.m->v_at[j]] : 0;
}

/* Poses of all links in their parent links. */
static void pose_joints(work k, const double *q) {
    const mbs_tree *m = k.m;
    if (m->plain)
        gather(k, X, q);
    else
        for (int j = 0; j < k.n; ++j) CELL(X, j) = m->q_at[j] < 0 ? 0 : q[m->q_at[j]];
    clear_ends(k, X, 3); /* X, QD, QDD */
    EVERY_LANE {
        V sine, cosine;
        mbs_sincos_wide(TL1(MBS_TURN) * L1(X), &sine, &cosine);
        const V3 c0 = TL3(MBS_C), c1 = TL3(MBS_C + 3), c2 = TL3(MBS_C + 6);
        PUT3(E, more(times(cosine, c0), sine, c1));
        PUT3(E + 3, more(times(cosine, c1), -sine, c0));
        PUT3(E + 6, c2);
        PUT3(T, more(TL3(MBS_T), TL1(MBS_SLIDE) * L1(X), c2));
    }
    several(k, q);
}

/* Origins of all links relative to the parent link and to the first link of the tree, and their
 * velocities relative to the common point. */
static void places(work k) {
    const mbs_tree *m = k.m;
    EVERY_LANE {
        const double *from[MBS_LANES];
        for (int l = 0; l < MBS_LANES; ++l)
            from[l] = (const double *)&k.nodes[1 + (j + l < k.n ? m->last[j + l] : j + l)].d;
        to_rows(k, j, from, 0, D, VO);
    }
    D3 p = {0, 0, 0};
    for (int j = 0, held = -1; j < k.n; held = j++) {
        const int b = m->before[j];
        if (b != held || b < 0) p = b < 0 ? (D3){0, 0, 0} : O3(P, b);
        if (b >= 0 && m->link[j] == b) p = plus(p, O3(D, j));
        PUT_O3(P, j, p);
    }
    clear_ends(k, P, 3);
}

static void poses(work k, const double *q) {
    pose_joints(k, q);
    poses_alone(k);
    in_lanes(k, 0);
}

/* First moments and inertia of all bodies in the axes of the base, about the link origins. */
static void bodies(work k) {
    EVERY_LANE {
        const V3 r0 = L3(R), r1 = L3(R + 3), r2 = L3(R + 6), h = TL3(MBS_H);
        PUT3(HB, combine(r0, h.x, r1, h.y, r2, h.z));
        const V xx = TL1(MBS_J), xy = TL1(MBS_J + 1), xz = TL1(MBS_J + 2), yy = TL1(MBS_J + 3),
                yz = TL1(MBS_J + 4), zz = TL1(MBS_J + 5);
        const V3 a = combine(r0, xx, r1, xy, r2, xz), b = combine(r0, xy, r1, yy, r2, yz),
                 c = combine(r0, xz, r1, yz, r2, zz);
        PUT1(JB, a.x * r0.x + b.x * r1.x + c.x * r2.x);
        PUT1(JB + 1, a.x * r0.y + b.x * r1.y + c.x * r2.y);
        PUT1(JB + 2, a.x * r0.z + b.x * r1.z + c.x * r2.z);
        PUT1(JB + 3, a.y * r0.y + b.y * r1.y + c.y * r2.y);
        PUT1(JB + 4, a.y * r0.z + b.y * r1.z + c.y * r2.z);
        PUT1(JB + 5, a.z * r0.z + b.z * r1.z + c.z * r2.z);
    }
}

/* Product of a vector and a symmetric inertia matrix with the elements xx xy xz yy yz zz. */
#define INERTIA_TIMES(J, a)                            \
    {(J)[0] * (a).x + (J)[1] * (a).y + (J)[2] * (a).z, \
     (J)[1] * (a).x + (J)[3] * (a).y + (J)[4] * (a).z, \
     (J)[2] * (a).x + (J)[4] * (a).y + (J)[5] * (a).z}
#define LANES6(name, row)                                           \
    const V name[6] = {L1(row),       L1((row) + 1), L1((row) + 2), \
                       L1((row) + 3), L1((row) + 4), L1((row) + 5)}

/* Angular momentum of the rotors for unit joint velocities, in the axes of the base. */
static void spins(work k) {
    if (!k.m->rotors) return;
    EVERY_LANE PUT3(GB, ((V3){mbs_all(0), mbs_all(0), mbs_all(0)}));
    for (int r = 0; r < k.m->rotors; ++r) {
        const int node = k.m->rotor[2 * r], c = k.m->rotor[2 * r + 1];
        const D3 g = T3(MBS_SPIN, node);
        PUT_O3(GB, node, combine(O3(R, c), g.x, O3(R + 3, c), g.y, O3(R + 6, c), g.z));
    }
}

/* Body wrenches, then their sums over the subtree of each node (backward pass). */
static void wrenches(work k) {
    const mbs_tree *m = k.m;
    EVERY_LANE {
        const V3 w = L3(W), wd = L3(WD), vd = L3(VD), h = L3(HB);
        LANES6(J, JB);
        const V3 Jw = INERTIA_TIMES(J, w), Jwd = INERTIA_TIMES(J, wd);
        PUT3(F, plus_cross(plus_cross(times(TL1(MBS_MASS), vd), wd, h), w, cross(w, h)));
        PUT3(M, plus_cross(plus_cross(Jwd, w, Jw), h, vd));
    }
    for (int r = 0; r < m->rotors; ++r) {
        const int node = m->rotor[2 * r], c = m->rotor[2 * r + 1];
        const D3 g = O3(GB, node), turning = cross(O3(W, c), times(CELL(QD, node), g));
        PUT_O3(M, c, plus(O3(M, c), more(turning, CELL(QDD, node), g)));
    }
    D3 f = {0, 0, 0}, mo = {0, 0, 0};
    for (int j = k.n - 1, held = -1; j >= 0; --j) {
        const int b = m->before[j];
        D3 here = O3(F, j), there = O3(M, j);
        if (held == j) { /* add the wrench from the only child node, or from the first of several */
            here = plus(here, f), there = plus(there, mo);
            PUT_O3(F, j, here);
            PUT_O3(M, j, there);
        }
        if (b < 0) continue;
        if (m->link[j] == b) {
            const double *d = (const double *)&k.nodes[1 + j].d;
            there = plus_cross(there, ((D3){d[0], d[1], d[2]}), here);
        }
        if (b == j - 1) {
            f = here, mo = there, held = b;
        } else {
            PUT_O3(F, b, plus(O3(F, b), here));
            PUT_O3(M, b, plus(O3(M, b), there));
        }
    }
}

/* Efforts of all nodes: projected wrenches, rotors, friction and springs of the joints. */
static void efforts(work k) {
    const mbs_tree *m = k.m;
    EVERY_LANE {
        V tau = dot(L3(SL), L3(F)) + dot(L3(SA), L3(M));
        tau += TL1(MBS_IA) * L1(QDD) + TL1(MBS_FV) * L1(QD);
        tau += TL1(MBS_STIFFNESS) * (L1(X) - TL1(MBS_REST));
        PUT1(TAU, tau);
    }
    for (int r = 0; r < m->rotors; ++r) {
        const int node = m->rotor[2 * r], c = m->rotor[2 * r + 1];
        CELL(TAU, node) += dot(O3(GB, node), O3(WD, c));
    }
    for (int r = 0; r < m->rubbing; ++r) {
        const int node = m->rub[r];
        const double v = CELL(QD, node), width = FACT(MBS_WIDTH, node);
        CELL(TAU, node) += FACT(MBS_FS, node) * (width == 0 ? (v > 0) - (v < 0) : tanh(v / width));
    }
    const int *joint = m->joints;
    for (int c = 0; c < m->many; ++c, joint += 3)
        if (joint[1] == 6) { /* rotor inertia of a free joint along rotating axes: Ia (a + w x v) */
            const int first = joint[0];
            double v[6], Ia[3];
            for (int h = 0; h < 6; ++h) v[h] = CELL(QD, first + h);
            for (int h = 0; h < 3; ++h) Ia[h] = FACT(MBS_IA, first + h);
            const D3 turned = cross(((D3){v[3], v[4], v[5]}), ((D3){v[0], v[1], v[2]}));
            CELL(TAU, first) += Ia[0] * turned.x;
            CELL(TAU, first + 1) += Ia[1] * turned.y;
            CELL(TAU, first + 2) += Ia[2] * turned.z;
        }
}

/* Inverse dynamics in the work space. If `a` is null, the accelerations are zero. */
static void inverse(work k, const double *q, const double *v, const double *a) {
    gather(k, QD, v);
    gather(k, QDD, a);
    pose_joints(k, q);
    poses_and_motions(k);
    in_lanes(k, 1);
    bodies(k);
    spins(k);
    wrenches(k);
    efforts(k);
}

void mbs_tree_idm(const mbs_tree *m, const double *q, const double *v, const double *a, double *tau,
                  double *w) {
    const work k = space_of(m, w);
    inverse(k, q, v, a);
    if (tau)
        for (int j = 0; j < k.n; ++j) tau[m->v_at[j]] = CELL(TAU, j);
}

/* Mass, first moments and inertia of the subtree of each node (composite bodies). */
static void composites(work k) {
    const mbs_tree *m = k.m;
    EVERY_LANE {
        PUT1(CM, TL1(MBS_MASS));
        PUT3(CH, L3(HB));
        for (int r = 0; r < 6; ++r) PUT1(CJ + r, L1(JB + r));
    }
    double sum = 0, I[6] = {0};
    D3 h = {0, 0, 0};
    for (int j = k.n - 1, held = -1; j >= 0; --j) {
        const int b = m->before[j];
        if (held == j) {
            CELL(CM, j) = sum += CELL(CM, j);
            h = plus(O3(CH, j), h);
            PUT_O3(CH, j, h);
            for (int r = 0; r < 6; ++r) CELL(CJ + r, j) = I[r] += CELL(CJ + r, j);
        } else {
            sum = CELL(CM, j), h = O3(CH, j);
            for (int r = 0; r < 6; ++r) I[r] = CELL(CJ + r, j);
        }
        if (b < 0) continue;
        if (m->link[j] == b) {
            const D3 d = O3(D, j), e = more(h, 0.5 * sum, d);
            const double xx = d.x * e.x, yy = d.y * e.y, zz = d.z * e.z;
            h = more(h, sum, d);
            I[0] += 2 * (yy + zz);
            I[1] -= d.x * e.y + d.y * e.x;
            I[2] -= d.x * e.z + d.z * e.x;
            I[3] += 2 * (xx + zz);
            I[4] -= d.y * e.z + d.z * e.y;
            I[5] += 2 * (xx + yy);
        }
        if (b == j - 1) {
            held = b;
        } else {
            CELL(CM, b) += sum;
            PUT_O3(CH, b, plus(O3(CH, b), h));
            for (int r = 0; r < 6; ++r) CELL(CJ + r, b) += I[r];
        }
    }
}

/* Momentum of the subtree of each node for its unit velocity, and the unit velocities, about the
 * common point. TAU becomes the diagonal of the inertia matrix. */
static void momenta(work k) {
    EVERY_LANE {
        const V3 sl = L3(SL), sa = L3(SA), h = L3(CH), p = L3(P);
        LANES6(J, CJ);
        const V3 Jsa = INERTIA_TIMES(J, sa);
        const V3 f = plus_cross(times(L1(CM), sl), sa, h), l = plus_cross(Jsa, h, sl);
        PUT1(TAU, dot(sl, f) + dot(sa, l) + TL1(MBS_IA));
        const V3 fa = plus_cross(l, p, f), sc = plus_cross(sl, p, sa);
        PUT3(FL, f);
        PUT3(FA, fa);
        PUT3(SC, sc);
    }
    for (int r = 0; r < k.m->rotors; ++r) {
        const int node = k.m->rotor[2 * r], own = k.m->rotor[2 * r + 1] == node;
        const D3 g = O3(GB, node);
        PUT_O3(FA, node, plus(O3(FA, node), g));
        if (own) CELL(TAU, node) += 2 * dot(g, O3(SA, node));
    }
}

/* Store lanes to a column of a matrix; only the lanes `from` to `to` - 1 are written. */
INLINE void put_column(double *x, int from, int to, V value) {
#if MBS_LANES == 8
    const unsigned mask = (0xffu << (from > 0 ? from : 0)) & (0xffu >> (to < 8 ? 8 - to : 0));
    _mm512_mask_storeu_pd(x, (__mmask8)mask, (__m512d)value);
#else
    if (__builtin_expect(from <= 0 && to >= MBS_LANES, 1))
        *(U *)x = (U)value;
    else
        for (int l = from > 0 ? from : 0; l < to && l < MBS_LANES; ++l) x[l] = value[l];
#endif
}
INLINE V3 all3(D3 a) { return (V3){mbs_all(a.x), mbs_all(a.y), mbs_all(a.z)}; }
#define ALL3(row, node) all3(O3(row, node))
INLINE void zeros(double *x, int count) {
    for (int j = 0; j < count; ++j) x[j] = 0;
}

/* Permute a matrix from the order of the tree to the order of v, in place. */
static void reorder(work k, double *x) {
    if (k.m->in_order || !x) return;
    const size_t n = (size_t)k.n;
    memcpy(k.square, x, n * n * sizeof(double));
    for (size_t c = 0; c < n; ++c)
        for (size_t r = 0; r < n; ++r)
            x[(size_t)k.m->v_at[r] + n * (size_t)k.m->v_at[c]] = k.square[r + n * c];
}

/* Make the blocks of joints of several velocities in the inertia matrix exactly symmetric. */
static void mirror(work k, double *A) {
    const size_t n = (size_t)k.n;
    const int *joint = k.m->joints;
    for (int c = 0; c < k.m->many; ++c, joint += 3) {
        double *block = A + (size_t)joint[0] * (n + 1);
        for (size_t x = 0; x < (size_t)joint[1]; ++x)
            for (size_t y = x + 1; y < (size_t)joint[1]; ++y) block[x + n * y] = block[y + n * x];
    }
}

/* Loop over the vectors that contain the nodes `from` to `to` - 1. */
#define LANES_OF(from, to) for (int j = (from) & -MBS_LANES; j < (to); j += MBS_LANES)

/* Inertia matrix, column by column: ancestors of the joint, then the joint and its subtree. */
static void inertia(work k, double *A) {
    const mbs_tree *m = k.m;
    for (int c = 0; c < k.n; ++c, A += k.n) {
        const V3 fl = ALL3(FL, c), fa = ALL3(FA, c), sl = ALL3(SC, c), sa = ALL3(SA, c);
        int done = 0;
        for (int r = m->runs_from[c]; r < m->runs_from[c + 1]; ++r) {
            const int from = m->runs[2 * r], to = m->runs[2 * r + 1];
            zeros(A + done, from - done);
            LANES_OF(from, to)
                put_column(A + j, from - j, to - j, dot(fl, L3(SC)) + dot(fa, L3(SA)));
            done = to;
        }
        zeros(A + done, m->first[c] - done);
        const int first = m->first[c], end = m->end[c];
        LANES_OF(first, end)
            put_column(A + j, first - j, end - j, dot(L3(FL), sl) + dot(L3(FA), sa));
        A[c] = CELL(TAU, c);
        zeros(A + end, k.n - end);
    }
}

/* Momenta of the composite bodies at q, from which the inertia matrix is formed. */
static void composites_at(work k, const double *q) {
    poses(k, q);
    places(k);
    bodies(k);
    spins(k);
    composites(k);
    momenta(k);
}

void mbs_tree_inertia(const mbs_tree *m, const double *q, double *A, double *w) {
    const work k = space_of(m, w);
    if (!A) return;
    composites_at(k, q);
    inertia(k, A);
    mirror(k, A);
    reorder(k, A);
}

/* Sum over the nodes of a joint of a row times the velocity. */
static D3 of_joint(work k, int row, const int *joint) {
    D3 total = {0, 0, 0};
    for (int h = 0; h < joint[1]; ++h)
        total = more(total, CELL(QD, joint[0] + h), O3(row, joint[0] + h));
    return total;
}

/* Motions of the parent links. Velocities VL are relative to the common point, which moves with the
 * first link of the tree. */
static void links_before(work k) {
    const mbs_tree *m = k.m;
    EVERY_LANE {
        const double *from[MBS_LANES];
        for (int l = 0; l < MBS_LANES; ++l)
            from[l] = (const double *)&k.nodes[1 + (j + l < k.n ? m->link[j + l] : -1)].r2;
        to_rows(k, j, from, 0, WDL, WL); /* r2 and w; WDL is overwritten by the next line */
        to_rows(k, j, from, 8, WDL, VDL);
        to_rows(k, j, from, 16, VL, VL); /* d and vo; the second one remains */
        /* velocity of the point of the parent link that coincides with the origin of the link */
        const V inner = TL1(MBS_INNER), v = inner * L1(QD) - L1(QD);
        PUT3(VL, more(plus_cross(times(inner, L3(VL)), L3(WL), L3(D)), v, L3(SL)));
    }
    const int *joint = m->joints;
    for (int c = 0; c < m->many; ++c, joint += 3)
        if (m->link[joint[0]] < 0) {
            const D3 behind = times(-1, of_joint(k, SL, joint));
            for (int h = 0; h < joint[1]; ++h) PUT_O3(VL, joint[0] + h, behind);
        }
}

/* Twice the momentum of the subtree of each node, and the matrix K: the moment that an angular
 * velocity s adds is K s = 2 (tr(N) - N) s, where N is the integral of velocity times position. */
static void moving_composites(work k) {
    const mbs_tree *m = k.m;
    EVERY_LANE {
        const V3 w = L3(W), v = L3(VO), h = L3(HB);
        LANES6(J, JB);
        const V mass = TL1(MBS_MASS), trace = J[0] + J[3] + J[5];
        const V3 n = times(mbs_all(2), plus_cross(times(mass, v), w, h)), v2 = times(mbs_all(2), v);
        const V vh = dot(v2, h);
        /* column c of K: 2 w x J_c - trace w x e_c + 2 (v . h) e_c - 2 v h_c */
        const V3 w2 = times(mbs_all(2), w);
        V3 x = cross(w2, ((V3){J[0], J[1], J[2]})), y = cross(w2, ((V3){J[1], J[3], J[4]})),
           z = cross(w2, ((V3){J[2], J[4], J[5]}));
        x = more(x, -h.x, v2), y = more(y, -h.y, v2), z = more(z, -h.z, v2);
        x.x += vh, x.y -= trace * w.z, x.z += trace * w.y;
        y.y += vh, y.x += trace * w.z, y.z -= trace * w.x;
        z.z += vh, z.x -= trace * w.y, z.y += trace * w.x;
        PUT3(N2, n);
        PUT3(K, x);
        PUT3(K + 3, y);
        PUT3(K + 6, z);
    }
    for (int r = 0; r < m->rotors; ++r) { /* K - spin x, with the spin of the rotor */
        const int node = m->rotor[2 * r], c = m->rotor[2 * r + 1];
        const D3 s = times(CELL(QD, node), O3(GB, node));
        CELL(K + 1, c) -= s.z, CELL(K + 2, c) += s.y;
        CELL(K + 3, c) += s.z, CELL(K + 5, c) -= s.x;
        CELL(K + 6, c) -= s.y, CELL(K + 7, c) += s.x;
    }
    D3 n = {0, 0, 0}, x = n, y = n, z = n;
    for (int j = k.n - 1, held = -1; j >= 0; --j) {
        const int b = m->before[j];
        if (held == j) {
            n = plus(n, O3(N2, j)), x = plus(x, O3(K, j)), y = plus(y, O3(K + 3, j));
            z = plus(z, O3(K + 6, j));
            PUT_O3(N2, j, n);
            PUT_O3(K, j, x);
            PUT_O3(K + 3, j, y);
            PUT_O3(K + 6, j, z);
        } else {
            n = O3(N2, j), x = O3(K, j), y = O3(K + 3, j), z = O3(K + 6, j);
        }
        if (b < 0) continue;
        if (m->link[j] == b) { /* shift to the origin of the parent link: add (n . d) - n d' */
            const D3 d = O3(D, j);
            const double nd = dot(n, d);
            x = more(x, -d.x, n), y = more(y, -d.y, n), z = more(z, -d.z, n);
            x.x += nd, y.y += nd, z.z += nd;
        }
        if (b == j - 1) {
            held = b;
        } else {
            PUT_O3(N2, b, plus(O3(N2, b), n));
            PUT_O3(K, b, plus(O3(K, b), x));
            PUT_O3(K + 3, b, plus(O3(K + 3, b), y));
            PUT_O3(K + 6, b, plus(O3(K + 6, b), z));
        }
    }
}

/* Derivatives of the subtree wrench of each node with respect to its position and velocity, and
 * the terms by which its effort depends on the motion of other nodes. */
static void changes(work k) {
    const mbs_tree *m = k.m;
    EVERY_LANE {
        const V3 sl = L3(SL), sa = L3(SA), wl = L3(WL), w = L3(W), wdl = L3(WDL), vl = L3(VL),
                 p = L3(P);
        const V3 d = L3(D), h = L3(CH), n = L3(N2), k0 = L3(K), k1 = L3(K + 3), k2 = L3(K + 6);
        const V mass = L1(CM);
        LANES6(J, CJ);
        /* acceleration of the point of the parent link, minus w x v: the linear part of a twist */
        const V3 swing = cross(wl, d);
        const V3 al = plus_cross(plus_cross(L3(VDL), wdl, d), wl, minus(swing, vl));
        /* rates of the unit velocity S of the node: y = v x S, y2 = a x S + v x y; v: parent */
        const V3 yl = plus_cross(cross(wl, sl), vl, sa), ya = cross(wl, sa);
        const V3 y2l = plus_cross(plus_cross(plus_cross(cross(wdl, sl), al, sa), wl, yl), vl, ya);
        const V3 y2a = plus_cross(cross(wdl, sa), wl, ya);
        const V3 ysl = plus_cross(plus_cross(yl, w, sl), L3(VO), sa), ysa = plus_cross(ya, w, sa);
        PUT3(YA, ya);
        PUT3(Y2L, plus_cross(y2l, p, y2a));
        PUT3(Y2A, y2a);
        PUT3(YSL, plus_cross(ysl, p, ysa));
        PUT3(YSA, ysa);
        /* effort per angular velocity of the subtree: K' sa + n x sl */
        PUT3(GA, plus_cross(((V3){dot(k0, sa), dot(k1, sa), dot(k2, sa)}), n, sl));
        /* derivative of the wrench by the position: I y2 + K y + S x f */
        const V3 Jy2 = INERTIA_TIMES(J, y2a), Jys = INERTIA_TIMES(J, ysa);
        const V3 f = L3(F);
        const V3 ql = plus_cross(plus_cross(plus_cross(times(mass, y2l), y2a, h), ya, n), sa, f);
        const V3 qa = plus_cross(
            plus_cross(plus_cross(plus(Jy2, combine(k0, ya.x, k1, ya.y, k2, ya.z)), h, y2l), sa,
                       L3(M)),
            sl, f);
        PUT3(DQL, ql);
        PUT3(DQA, plus_cross(qa, p, ql));
        /* derivative of the wrench by the velocity: I ys + K sa */
        const V3 ul = plus_cross(plus_cross(times(mass, ysl), ysa, h), sa, n);
        const V3 ua = plus_cross(plus(Jys, combine(k0, sa.x, k1, sa.y, k2, sa.z)), h, ysl);
        PUT3(DVL, ul);
        PUT3(DVA, plus_cross(ua, p, ul));
    }
    for (int r = 0; r < m->rotors; ++r) {
        const int node = m->rotor[2 * r], c = m->rotor[2 * r + 1];
        const D3 turning = cross(O3(W, c), O3(GB, node));
        PUT_O3(GA, node, plus(O3(GA, node), turning));
        PUT_O3(DVA, node, plus(O3(DVA, node), turning));
    }
}

/* Derivatives of the efforts by positions and velocities, and the inertia matrix, column by column
 * from the top as in `inertia`. A matrix may be null; its columns are then discarded. */
static void pairs(work k, double *dq, double *dv, double *A) {
    const mbs_tree *m = k.m;
    const size_t n = (size_t)k.n;
    const size_t step_q = dq ? n : 0, step_v = dv ? n : 0, step_a = A ? n : 0;
    if (!dq) dq = k.column;
    if (!dv) dv = k.column;
    if (!A) A = k.column;
    for (int c = 0; c < k.n; ++c, dq += step_q, dv += step_v, A += step_a) {
        const V3 ql = ALL3(DQL, c), qa = ALL3(DQA, c), ul = ALL3(DVL, c), ua = ALL3(DVA, c);
        const V3 fl = ALL3(FL, c), fa = ALL3(FA, c);
        int done = 0;
        for (int r = m->runs_from[c]; r < m->runs_from[c + 1]; ++r) {
            const int from = m->runs[2 * r], to = m->runs[2 * r + 1];
            zeros(dq + done, from - done);
            zeros(dv + done, from - done);
            zeros(A + done, from - done);
            LANES_OF(from, to) {
                const V3 sl = L3(SC), sa = L3(SA);
                put_column(dq + j, from - j, to - j, dot(ql, sl) + dot(qa, sa));
                put_column(dv + j, from - j, to - j, dot(ul, sl) + dot(ua, sa));
                put_column(A + j, from - j, to - j, dot(fl, sl) + dot(fa, sa));
            }
            done = to;
        }
        const int first = m->first[c], end = m->end[c];
        zeros(dq + done, first - done);
        zeros(dv + done, first - done);
        zeros(A + done, first - done);
        const V3 sl = ALL3(SC, c), sa = ALL3(SA, c), ya = ALL3(YA, c);
        const V3 y2l = ALL3(Y2L, c), y2a = ALL3(Y2A, c), ysl = ALL3(YSL, c), ysa = ALL3(YSA, c);
        LANES_OF(first, end) {
            const V3 l = L3(FL), a = L3(FA), g = L3(GA);
            put_column(dq + j, first - j, end - j, dot(l, y2l) + dot(a, y2a) + dot(g, ya));
            put_column(dv + j, first - j, end - j, dot(l, ysl) + dot(a, ysa) + dot(g, sa));
            put_column(A + j, first - j, end - j, dot(l, sl) + dot(a, sa));
        }
        zeros(dq + end, k.n - end);
        zeros(dv + end, k.n - end);
        zeros(A + end, k.n - end);
        /* spring and friction of the joint itself */
        const double v = CELL(QD, c), Fs = FACT(MBS_FS, c), width = FACT(MBS_WIDTH, c);
        dq[c] += FACT(MBS_STIFFNESS, c);
        dv[c] += FACT(MBS_FV, c);
        if (Fs != 0 && width != 0) {
            const double t = tanh(v / width);
            dv[c] += Fs * (1 - t * t) / width;
        }
        A[c] = CELL(TAU, c);
    }
}

/* Corrections of `pairs` for rotors. A rotor on its own link is also rotated by its joint. A rotor
 * on the parent link does not move with its own joint, but `changes` treats it as if it did. The
 * rotors of a free joint have rotating axes: Ia (a + w x v). */
static void turning_rotors(work k, double *dq, double *dv) {
    const mbs_tree *m = k.m;
    const size_t n = (size_t)k.n;
    for (int r = 0; r < m->rotors; ++r) {
        const int node = m->rotor[2 * r], c = m->rotor[2 * r + 1];
        const size_t at = (size_t)node * (n + 1);
        const D3 g = O3(GB, node), turning = cross(O3(W, c), g), sa = O3(SA, node);
        if (c == node) {
            if (dv) dv[at] += dot(sa, turning);
        } else {
            if (dq) dq[at] -= dot(g, O3(Y2A, node)) + dot(turning, O3(YA, node));
            if (dv) dv[at] -= dot(g, O3(YSA, node)) + dot(turning, sa);
        }
    }
    if (!dv) return;
    const int *joint = m->joints;
    for (int c = 0; c < m->many; ++c, joint += 3)
        if (joint[1] == 6)
            for (int x = 0; x < 3; ++x) {
                const int y = (x + 1) % 3, z = (x + 2) % 3;
                const size_t first = (size_t)joint[0];
                const double Ia = FACT(MBS_IA, joint[0] + x);
                double v[6];
                for (int h = 0; h < 6; ++h) v[h] = CELL(QD, joint[0] + h);
                double *row = dv + first + (size_t)x + n * first; /* row of element x of w x v */
                row[n * (size_t)z] += Ia * v[3 + y];
                row[n * (size_t)y] -= Ia * v[3 + z];
                row[n * (size_t)(3 + y)] += Ia * v[z];
                row[n * (size_t)(3 + z)] -= Ia * v[y];
            }
}

/* Derivatives of the efforts in the order of the tree; uses the work space left by `inverse`. */
static void slopes(work k, double *dq, double *dv, double *A) {
    places(k);
    links_before(k);
    composites(k);
    moving_composites(k);
    momenta(k);
    changes(k);
    pairs(k, dq, dv, A);
    if (A) mirror(k, A);
    turning_rotors(k, dq, dv);
}

void mbs_tree_idm_derivatives(const mbs_tree *m, const double *q, const double *v, const double *a,
                              double *dq, double *dv, double *A, double *tau, double *w) {
    const work k = space_of(m, w);
    inverse(k, q, v, a);
    if (tau)
        for (int j = 0; j < k.n; ++j) tau[m->v_at[j]] = CELL(TAU, j);
    slopes(k, dq, dv, A);
    reorder(k, dq);
    reorder(k, dv);
    reorder(k, A);
}

/* Elements of a record: factors of the inertia matrix at a node. */
enum { RS = 0, RU = 6, RD = 12, RP = 13 }; /* unit velocity, U / D, 1 / D, vector D of the origin */

/* A matrix of three columns. */
typedef struct {
    Q x, y, z;
} columns;

INLINE columns sum(columns a, columns b) { return (columns){a.x + b.x, a.y + b.y, a.z + b.z}; }
INLINE columns less(columns A, Q a, Q b) { /* A - a b' */
    return (columns){A.x - a * b[0], A.y - a * b[1], A.z - a * b[2]};
}
INLINE Q product(columns A, Q a) { return A.x * a[0] + A.y * a[1] + A.z * a[2]; }
INLINE columns crossed_columns(Q d, columns A) {
    return (columns){crossed(d, A.x), crossed(d, A.y), crossed(d, A.z)};
}
INLINE columns transposed(columns A) {
#if defined(MBS_PAIR)
    const Q none = {0, 0, 0, 0};
    const Q even = __builtin_shufflevector(A.x, A.y, 0, 4, 2, 6),
            odd = __builtin_shufflevector(A.x, A.y, 1, 5, 3, 7);
    const Q last = __builtin_shufflevector(A.z, none, 0, 4, 2, 6),
            next = __builtin_shufflevector(A.z, none, 1, 5, 3, 7);
    return (columns){__builtin_shufflevector(even, last, 0, 1, 4, 5),
                     __builtin_shufflevector(odd, next, 0, 1, 4, 5),
                     __builtin_shufflevector(even, last, 2, 3, 6, 7)};
#else
    return (columns){
        {A.x[0], A.y[0], A.z[0], 0}, {A.x[1], A.y[1], A.z[1], 0}, {A.x[2], A.y[2], A.z[2], 0}};
#endif
}

/* Articulated inertia (6 x 6): force = M al + N wd, moment = N' al + J wd. */
typedef struct {
    columns M, N, J;
} articulated;

INLINE void add(articulated *I, const articulated *other) {
    I->M = sum(I->M, other->M), I->N = sum(I->N, other->N), I->J = sum(I->J, other->J);
}

/* Add the inertia of the body of node j. */
INLINE void add_body(work k, articulated *I, int j) {
    const Q x = {1, 0, 0, 0}, y = {0, 1, 0, 0}, z = {0, 0, 1, 0};
    const double m = FACT(MBS_MASS, j), hx = CELL(HB, j), hy = CELL(HB + 1, j),
                 hz = CELL(HB + 2, j);
    I->M = sum(I->M, (columns){m * x, m * y, m * z});
    I->N = sum(I->N, (columns){hy * z - hz * y, hz * x - hx * z, hx * y - hy * x}); /* wd x h */
    I->J.x += CELL(JB, j) * x + CELL(JB + 1, j) * y + CELL(JB + 2, j) * z;
    I->J.y += CELL(JB + 1, j) * x + CELL(JB + 3, j) * y + CELL(JB + 4, j) * z;
    I->J.z += CELL(JB + 2, j) * x + CELL(JB + 4, j) * y + CELL(JB + 5, j) * z;
}

/* Shift an inertia to the point that lies at -d from the current reference point. */
INLINE void shift(articulated *I, Q d) {
    const columns M = I->M, before = transposed(crossed_columns(d, I->N));
    I->N.x += M.z * d[1] - M.y * d[2];
    I->N.y += M.x * d[2] - M.z * d[0];
    I->N.z += M.y * d[0] - M.x * d[1];
    I->J = sum(sum(I->J, before), crossed_columns(d, I->N));
}

INLINE double sum3(Q a) { return a[0] + a[1] + a[2]; }

/* Factorise the inertia matrix by articulated bodies; stores a record for each node. */
static void factorise(work k) {
    const mbs_tree *m = k.m;
    const Q zero = {0, 0, 0, 0};
    articulated *forks = (articulated *)k.lanes, I;
    memset(&I, 0, sizeof I);
    for (int j = 0; j < k.n; ++j)
        if (m->fork[j]) memset(forks + j, 0, sizeof I);
    for (int j = k.n - 1, held = -1; j >= 0; --j) {
        const int b = m->before[j], kind = m->kind[j];
        if (held != j) memset(&I, 0, sizeof I);
        if (m->fork[j]) add(&I, forks + j);
        if (m->last[j] == j) add_body(k, &I, j);
        const chain *node = k.nodes + 1 + j;
        Q sl = zero, sa = node->r2, l, a;
        if (kind == MBS_REVOLUTE) {
            l = product(I.N, sa);
            a = product(I.J, sa);
        } else {
            sl = (Q){CELL(SL, j), CELL(SL + 1, j), CELL(SL + 2, j), 0};
            sa = (Q){CELL(SA, j), CELL(SA + 1, j), CELL(SA + 2, j), 0};
            l = product(I.N, sa) + product(I.M, sl);
            a = product(I.J, sa) + (Q){sum3(I.N.x * sl), sum3(I.N.y * sl), sum3(I.N.z * sl), 0};
        }
        double inertia = sum3(sl * l + sa * a) + FACT(MBS_IA, j);
        if (m->rotors) { /* U + spin; a rotor on the link of its own joint is also rotated by it */
            const Q g = {CELL(GB, j), CELL(GB + 1, j), CELL(GB + 2, j), 0};
            a += g;
            inertia += 2 * FACT(MBS_OWN, j) * sum3(g * sa);
        }
        const double ratio = 1 / inertia;
        const Q lr = ratio * l, ar = ratio * a, d = m->first[j] == j ? node->d : zero;
        double *record = k.record + 16 * (size_t)j;
        memcpy(record + RS, &sl, 3 * sizeof(double));
        memcpy(record + RS + 3, &sa, 3 * sizeof(double));
        memcpy(record + RU, &lr, 3 * sizeof(double));
        memcpy(record + RU + 3, &ar, 3 * sizeof(double));
        memcpy(record + RP, &d, 3 * sizeof(double));
        record[RD] = ratio;
        if (b < 0) continue;
        I.M = less(I.M, l, lr), I.N = less(I.N, l, ar), I.J = less(I.J, a, ar);
        if (m->link[j] == b) shift(&I, d);
        if (b == j - 1)
            held = b;
        else
            add(forks + b, &I);
    }
}

/* Solve A x = right-hand side by the factors, in place, for W columns, or for W groups of columns
 * in lanes. Two groups are solved at once, because a single group waits for its own results. Nodes
 * from `count` on have a zero right-hand side, and their solution is not computed. `f` is the
 * wrench, then the acceleration, that passes from node to node. `at` stores six elements of f for
 * each node with several children. */
#define EACH(W) _Pragma("GCC unroll 2") for (int h = 0; h < W; ++h)
#define SIX(W, TO, OP, FROM)                                                    \
    EACH(W) {                                                                   \
        TO[0][h] OP FROM[0][h], TO[1][h] OP FROM[1][h], TO[2][h] OP FROM[2][h]; \
        TO[3][h] OP FROM[3][h], TO[4][h] OP FROM[4][h], TO[5][h] OP FROM[5][h]; \
    }
#define SOLVE(NAME, S, ALL, W)                                                                     \
    static void NAME(work k, S(*x)[W], int count, S(*at)[6][W]) {                                  \
        const int *before = k.m->before, *kind = k.m->kind, *fork = k.m->fork;                     \
        const S zero = ALL(0);                                                                     \
        S f[6][W], none[6][W];                                                                     \
        EACH(W)                                                                                    \
            none[0][h] = none[1][h] = none[2][h] = none[3][h] = none[4][h] = none[5][h] = zero;    \
        SIX(W, f, =, none)                                                                         \
        for (int j = 0; j < count; ++j)                                                            \
            if (fork[j]) SIX(W, at[j], =, none)                                                    \
        for (int j = count - 1, held = -1; j >= 0; --j) {                                          \
            const double *r = k.record + 16 * (size_t)j;                                           \
            const int b = before[j];                                                               \
            if (held != j) SIX(W, f, =, none)                                                      \
            if (fork[j]) SIX(W, f, +=, at[j])                                                      \
            EACH(W) {                                                                              \
                S u = x[j][h] - f[3][h] * r[3] - (f[4][h] * r[4] + f[5][h] * r[5]);                \
                if (kind[j] != MBS_REVOLUTE)                                                       \
                    u = u - f[0][h] * r[0] - (f[1][h] * r[1] + f[2][h] * r[2]);                    \
                x[j][h] = u;                                                                       \
                const S fx = f[0][h] + u * r[6], fy = f[1][h] + u * r[7], fz = f[2][h] + u * r[8]; \
                f[0][h] = fx;                                                                      \
                f[1][h] = fy;                                                                      \
                f[2][h] = fz;                                                                      \
                f[3][h] += u * r[9] + fz * r[14] - fy * r[15];                                     \
                f[4][h] += u * r[10] + fx * r[15] - fz * r[13];                                    \
                f[5][h] += u * r[11] + fy * r[13] - fx * r[14];                                    \
            }                                                                                      \
            if (b == j - 1)                                                                        \
                held = b;                                                                          \
            else if (b >= 0)                                                                       \
                SIX(W, at[b], +=, f)                                                               \
        }                                                                                          \
        for (int j = 0; j < count; ++j) {                                                          \
            const double *r = k.record + 16 * (size_t)j;                                           \
            const int b = before[j];                                                               \
            if (b < 0) {                                                                           \
                SIX(W, f, =, none)                                                                 \
            } else if (b != j - 1) {                                                               \
                SIX(W, f, =, at[b])                                                                \
            }                                                                                      \
            EACH(W) {                                                                              \
                const S wx = f[3][h], wy = f[4][h], wz = f[5][h];                                  \
                f[0][h] += wy * r[15] - wz * r[14];                                                \
                f[1][h] += wz * r[13] - wx * r[15];                                                \
                f[2][h] += wx * r[14] - wy * r[13];                                                \
                const S value = x[j][h] * r[12] - (wx * r[9] + wy * r[10] + wz * r[11]) -          \
                                (f[0][h] * r[6] + f[1][h] * r[7] + f[2][h] * r[8]);                \
                x[j][h] = value;                                                                   \
                f[3][h] = wx + value * r[3];                                                       \
                f[4][h] = wy + value * r[4];                                                       \
                f[5][h] = wz + value * r[5];                                                       \
                if (kind[j] != MBS_REVOLUTE) {                                                     \
                    f[0][h] += value * r[0];                                                       \
                    f[1][h] += value * r[1];                                                       \
                    f[2][h] += value * r[2];                                                       \
                }                                                                                  \
            }                                                                                      \
            if (fork[j]) SIX(W, at[j], =, f)                                                       \
        }                                                                                          \
    }
#define AS_IT_IS(x) (x)
SOLVE(solve_one, double, AS_IT_IS, 1)
SOLVE(solve_lanes, V, mbs_all, 2)

static void solve(work k, double *x) {
    solve_one(k, (double (*)[1])x, k.n, (double (*)[6][1])k.lanes);
}

/* Accelerations in the order of the tree, to k.column; `inverse` was called with a = 0. */
static void accelerations(work k, const double *tau) {
    double *a = k.column;
    for (int j = 0; j < k.n; ++j) a[j] = tau[k.m->v_at[j]] - CELL(TAU, j);
    factorise(k);
    solve(k, a);
}

void mbs_tree_ddm(const mbs_tree *m, const double *q, const double *v, const double *tau, double *a,
                  double *w) {
    const work k = space_of(m, w);
    inverse(k, q, v, 0);
    accelerations(k, tau);
    if (a)
        for (int j = 0; j < k.n; ++j) a[m->v_at[j]] = k.column[j];
}

/* to_lanes transposes columns of a matrix to lanes, with opposite sign; from_lanes transposes them
 * back. h selects the group of columns. Rows are processed in square blocks; the last block may
 * overlap the previous block. */
static void to_lanes(V (*rows)[2], int h, int count, int columns, const double *from, size_t step) {
    int first = 0;
#if defined(MBS_PAIR)
    while (count >= MBS_LANES && first < count) {
        if (first > count - MBS_LANES) first = count - MBS_LANES;
        V square[MBS_LANES];
        MBS_UNROLLED
        for (int l = 0; l < MBS_LANES; ++l)
            square[l] =
                l < columns ? -(V)(*(const U *)(from + step * (size_t)l + first)) : mbs_all(0);
        mbs_transpose(square);
        MBS_UNROLLED
        for (int r = 0; r < MBS_LANES; ++r) rows[first + r][h] = square[r];
        first += MBS_LANES;
    }
#endif
    for (int r = first; r < count; ++r)
        for (int l = 0; l < MBS_LANES; ++l)
            rows[r][h][l] = l < columns ? -from[step * (size_t)l + (size_t)r] : 0;
}

static void from_lanes(V (*rows)[2], int h, int count, int columns, double *to, size_t step) {
    int first = 0;
#if defined(MBS_PAIR)
    while (count >= MBS_LANES && first < count) {
        if (first > count - MBS_LANES) first = count - MBS_LANES;
        V square[MBS_LANES];
        MBS_UNROLLED
        for (int r = 0; r < MBS_LANES; ++r) square[r] = rows[first + r][h];
        mbs_transpose(square);
        MBS_UNROLLED
        for (int l = 0; l < MBS_LANES; ++l)
            if (l < columns) *(U *)(to + step * (size_t)l + first) = (U)square[l];
        first += MBS_LANES;
    }
#endif
    for (int l = 0; l < columns; ++l)
        for (int r = first; r < count; ++r) to[step * (size_t)l + (size_t)r] = rows[r][h][l];
}

INLINE int least(int a, int b) { return a < b ? a : b; }

/* Replace matrices by - A^-1 times the matrix; one of them may be null. */
static void solve_matrices(work k, double *dq, double *dv) {
    const size_t n = (size_t)k.n;
    V(*rows)[2] = (V(*)[2])(k.lanes + 12 * n);
    double *both[2] = {dq ? dq : dv, dv ? dv : dq};
    /* two groups of columns: one of each matrix, or two consecutive groups of the only matrix */
    const int step = dq && dv ? MBS_LANES : 2 * MBS_LANES;
    for (int c = 0; c < k.n; c += step) {
        const int at[2] = {c, dq && dv ? c : least(c + MBS_LANES, k.n)};
        for (int h = 0; h < 2; ++h)
            to_lanes(rows, h, k.n, least(k.n - at[h], MBS_LANES), both[h] + n * (size_t)at[h], n);
        solve_lanes(k, rows, k.n, (V(*)[6][2])k.lanes);
        for (int h = 0; h < 2; ++h)
            from_lanes(rows, h, k.n, least(k.n - at[h], MBS_LANES), both[h] + n * (size_t)at[h], n);
    }
}

/* A^-1. Only the upper triangle is solved, which needs no later nodes; it is then mirrored. */
static void inverse_matrix(work k, double *x) {
    const size_t n = (size_t)k.n;
    V(*rows)[2] = (V(*)[2])(k.lanes + 12 * n);
    for (int c = 0; c < k.n; c += 2 * MBS_LANES) {
        const int count = least(c + 2 * MBS_LANES, k.n);
        memset(rows, 0, (size_t)count * sizeof *rows);
        for (int r = c; r < count; ++r) rows[r][(r - c) / MBS_LANES][(r - c) % MBS_LANES] = 1;
        solve_lanes(k, rows, count, (V(*)[6][2])k.lanes);
        for (int h = 0; h < 2; ++h) {
            const int first = least(c + h * MBS_LANES, k.n);
            from_lanes(rows, h, count, least(k.n - first, MBS_LANES), x + n * (size_t)first, n);
        }
    }
    for (size_t c = 0; c < n; ++c)
        for (size_t r = c + 1; r < n; ++r) x[r + n * c] = x[c + n * r];
}

void mbs_tree_ddm_derivatives(const mbs_tree *m, const double *q, const double *v,
                              const double *tau, double *dq, double *dv, double *dtau, double *a,
                              double *w) {
    const work k = space_of(m, w);
    inverse(k, q, v, 0);
    accelerations(k, tau);
    const double *found = k.column;
    double *given = (double *)k.lanes; /* accelerations in the order of v */
    for (int j = 0; j < k.n; ++j) given[m->v_at[j]] = found[j];
    if (a) memcpy(a, given, (size_t)k.n * sizeof(double));
    if (dq || dv) {
        gather(k, QDD, given);
        poses_and_motions(k);
        in_lanes(k, 1);
        wrenches(k);
        slopes(k, dq, dv, 0);
        solve_matrices(k, dq, dv);
    }
    if (dtau) inverse_matrix(k, dtau);
    reorder(k, dq);
    reorder(k, dv);
    reorder(k, dtau);
}

void mbs_tree_pivots(const mbs_tree *m, const double *q, double *free_, double *locked, double *w) {
    const work k = space_of(m, w);
    composites_at(k, q);
    if (locked)
        for (int j = 0; j < k.n; ++j) locked[m->v_at[j]] = CELL(TAU, j);
    factorise(k);
    if (free_)
        for (int j = 0; j < k.n; ++j) free_[m->v_at[j]] = 1 / k.record[16 * (size_t)j + RD];
}

void mbs_tree_by_positions(const mbs_tree *m, const double *q, const double *along, double *by_q) {
    const size_t n = (size_t)m->size;
    for (int j = 0; j < m->size; ++j)
        if (m->q_at[j] >= 0)
            memcpy(by_q + n * (size_t)m->q_at[j], along + n * (size_t)m->v_at[j],
                   n * sizeof(double));
    const int *joint = m->joints;
    for (int c = 0; c < m->many; ++c, joint += 3) {
        const int count = joint[1], at = joint[2] + (count == 6 ? 3 : 0);
        const double *e = q + at;
        const double square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3];
        const double w = e[0], x = e[1], y = e[2], z = e[3];
        /* angular velocity per rate of the quaternion e = (w, x, y, z): 2 / |e|^2 (-e, w - e x)' */
        const double by[4][3] = {{-x, -y, -z}, {w, -z, y}, {z, w, -x}, {-y, x, w}};
        for (int h = 0; h < 4; ++h) {
            double *to = by_q + n * (size_t)(at + h);
            const double *turn[3];
            for (int r = 0; r < 3; ++r)
                turn[r] = along + n * (size_t)m->v_at[joint[0] + count - 3 + r];
            for (size_t i = 0; i < n; ++i)
                to[i] = 2 / square *
                        (by[h][0] * turn[0][i] + by[h][1] * turn[1][i] + by[h][2] * turn[2][i]);
        }
        if (count != 6) continue;
        const D3 Q[3] = {{w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y)},
                         {2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x)},
                         {2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z}};
        for (int h = 0; h < 3; ++h) { /* linear velocity per rate of the position: rows of Q */
            double *to = by_q + n * (size_t)(joint[2] + h), row[3];
            for (int r = 0; r < 3; ++r)
                row[r] = (h == 0 ? Q[r].x : h == 1 ? Q[r].y : Q[r].z) / square;
            for (size_t i = 0; i < n; ++i) {
                double sum = 0;
                for (int r = 0; r < 3; ++r)
                    sum += row[r] * along[n * (size_t)m->v_at[joint[0] + r] + i];
                to[i] = sum;
            }
        }
    }
}

static double *pack_run(const double *column, int from, int to, double *packed) {
    memcpy(packed, column + from, (size_t)(to - from) * sizeof(double));
    return packed + (to - from);
}

void mbs_tree_pack(const mbs_tree *m, const int *nodes, int columns, int coupled,
                   const double *dense, double *packed) {
    for (int c = 0; c < columns; ++c, dense += m->size) {
        int node = nodes[c];
        if (coupled) {
            while (m->link[node] >= 0) node = m->link[node];
        } else {
            for (int r = m->runs_from[node]; r < m->runs_from[node + 1]; ++r)
                packed = pack_run(dense, m->runs[2 * r], m->runs[2 * r + 1], packed);
        }
        packed = pack_run(dense, m->first[node], m->end[node], packed);
    }
}
