"""Maps from a QP to an easier one, see `namlcp.qp.route.Chain`."""
