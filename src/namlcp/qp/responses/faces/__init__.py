"""QPs with matrices of one pattern, one after another, by their active faces.

A face is the set of all x that hold the active rows of the last solved QP with
equality. Its KKT matrix is factored, and factored again, in the same order, when rows
become active or cease to be; nothing depends on P being definite or on the matrices
staying the same. So this solves what responses leave: a P that is singular
where A x = 0, other values in the matrices with every QP, and many active rows. It
needs a solution to begin with.

With the active rows of G as G_a, and variables at active bounds held there,

    [P    A'  G_a'] [x]   [-q ]
    [A            ] [y] = [b  ]
    [G_a          ] [z]   [h_a]

is solved by proximal iterations from the last point: the factors are those of the
matrix with SHIFT added to the diagonal of P and subtracted in the other two blocks.
They converge where active rows depend on each other, and where the face has many
solutions, to one near the last point. The next face has the active rows whose
multipliers have the right sign and the violated ones: a primal-dual active-set method
(Hintermueller, Ito and Kunisch, SIAM J. Optim. 13 (2003) 865-888). It has no proof of
its end, so another method solves what is not solved after MOST_FACES.

`state` is the record, `system` a face's KKT system, `sides` the way from face to face,
`run` the kernel, `solve` the class.
"""

from namlcp.qp.responses.faces.solve import Faces
