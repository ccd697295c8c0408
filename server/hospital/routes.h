#pragma once

#include "server/hospital/orders/orders.h"
#include "server/http/app/app.h"

namespace isomesh::hospital {

// `orders` is null if no hospital is configured; the routes then respond with that error. Both must
// outlive the routes.
void add_order_routes(http::App& app, orders::Orders* orders);

}  // namespace isomesh::hospital
