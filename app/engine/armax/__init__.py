"""ARMAX models: all orders of a search space for a whole valve grid at once, and exact fits of single orders."""

from app.engine.armax.model import ArmaxModel, Criterion, Order, OrderSearch, SearchSpace
from app.engine.armax.refine import refine
from app.engine.armax.search import estimate_order, search_orders

__all__ = [
    "ArmaxModel",
    "Criterion",
    "Order",
    "OrderSearch",
    "SearchSpace",
    "estimate_order",
    "refine",
    "search_orders",
]
