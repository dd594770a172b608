/* Models of open trees of rigid bodies, for which a mechanism is a table of numbers.
 *
 * Everything runs over the velocities in the order of the tree: a joint comes after the link that
 * it is on, and the subtree behind it follows without a gap. A joint of several velocities (three
 * of a spherical joint, six of a free one) is as many nodes, which share the pose of its link;
 * the inertia is at the last of them. */
#ifndef MBS_TREE_CORE_H
#define MBS_TREE_CORE_H

/* Rows of the table of numbers: of eight nodes side by side all rows, then of the next eight. */
enum {
    MBS_C = 0,          /* 9: axes of the link at zero in those of the link before, by columns */
    MBS_T = 9,          /* 3: its origin there [m] */
    MBS_MASS = 12,      /* 1: of what is fixed on the link; zero but at the last node of a joint */
    MBS_H = 13,         /* 3: first moments about its origin, in its axes */
    MBS_J = 16,         /* 6: inertia xx xy xz yy yz zz, likewise */
    MBS_TURN = 22,      /* 1: one for a revolute joint, else zero */
    MBS_SLIDE = 23,     /* 1: one for a prismatic joint, else zero */
    MBS_INNER = 24,     /* 1: zero where the joint is on the base, else one */
    MBS_IA = 25,        /* 1: inertia of rotors seen at the joint */
    MBS_FV = 26,        /* 1: viscous friction */
    MBS_STIFFNESS = 27, /* 1: of the spring, which is at rest at */
    MBS_REST = 28,      /* 1 */
    MBS_FS = 29,        /* 1: Coulomb friction, whose sign changes over the velocity */
    MBS_WIDTH = 30,     /* 1: zero for a step */
    MBS_SPIN = 31, /* 3: angular momentum of a rotor for a unit velocity, in axes of its carrier */
    MBS_OWN = 34,  /* 1: one where this rotor is on the link of the joint itself, else zero */
    MBS_ROWS = 35
};

/* Kinds of motion of a node: along and about z; about x, y and z of a joint of several velocities,
 * of which MBS_SEVERAL + 0, 1, 2 turn and MBS_SEVERAL + 3, 4, 5 slide. */
enum { MBS_REVOLUTE, MBS_PRISMATIC, MBS_SEVERAL };

typedef struct {
    int size;      /* velocities */
    int positions; /* elements of q */
    int in_order;  /* whether v has the order of the tree */
    int plain;     /* whether q has it too, element by element */
    int many;      /* joints of several velocities */
    int rotors;    /* joints with a rotor that spins */
    int rubbing;   /* velocities with Coulomb friction */
    const int
        *before;     /* of each node the one before it: of its joint or of the link before; or -1 */
    const int *link; /* the last node of the link before, or -1 */
    const int *end;  /* after the last node of the subtree */
    const int *first;     /* the first node of its joint */
    const int *last;      /* and the last one */
    const int *kind;      /* of its motion, see above */
    const int *fork;      /* whether something behind it is not at the next node */
    const int *q_at;      /* where the position stands, -1 for a joint of several velocities */
    const int *v_at;      /* where the velocity stands */
    const int *runs_from; /* size + 1: where the runs of nodes of the links before begin in */
    const int *runs;      /* pairs, in their order: first node, node after the last */
    const int *joints;    /* of each joint of several velocities: first node, their number, its q */
    const int *rotor;     /* pairs: node, and node of the link that carries the rotor */
    const int *rub;       /* nodes */
    const double *gravity; /* 3, in the base */
    const double *numbers; /* the table, aligned to 64 bytes */
} mbs_tree;

/* Doubles of work space of any of the models. */
#define MBS_TREE_WORK(size, in_order) \
    (176 * (((size) + 7) / 8 * 8) + 128 * (size) + ((in_order) ? 0 : (size) * (size)) + 40)

/* tau: efforts for accelerations a. */
void mbs_tree_idm(const mbs_tree *m, const double *q, const double *v, const double *a, double *tau,
                  double *w);
/* A: inertia matrix, by columns. */
void mbs_tree_inertia(const mbs_tree *m, const double *q, double *A, double *w);
/* a: accelerations for efforts tau. */
void mbs_tree_ddm(const mbs_tree *m, const double *q, const double *v, const double *tau, double *a,
                  double *w);
/* Derivatives of the efforts along the velocities, by v and by a, and the efforts; by columns.
 * Any may be null. */
void mbs_tree_idm_derivatives(const mbs_tree *m, const double *q, const double *v, const double *a,
                              double *dq, double *dv, double *A, double *tau, double *w);
/* Derivatives of the accelerations along the velocities, by v and by tau, and the accelerations;
 * by columns. Any may be null. */
void mbs_tree_ddm_derivatives(const mbs_tree *m, const double *q, const double *v,
                              const double *tau, double *dq, double *dv, double *dtau, double *a,
                              double *w);
/* The inertia that each velocity moves while those behind it are free, and while they are
 * locked. */
void mbs_tree_pivots(const mbs_tree *m, const double *q, double *free_, double *locked, double *w);
/* Derivatives by q of those along the velocities: rows of `along` times the velocities of q. */
void mbs_tree_by_positions(const mbs_tree *m, const double *q, const double *along, double *by_q);
/* The elements of columns that need not be zero, one after the other; m must be in order. Column c
 * is of node nodes[c]: its rows are the nodes before and behind it or, where all joints of a tree
 * are coupled, all of its tree. */
void mbs_tree_pack(const mbs_tree *m, const int *nodes, int columns, int coupled,
                   const double *dense, double *packed);

#endif
