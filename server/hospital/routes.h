// The routes of orders and PACS.
#pragma once

#include "server/hospital/orders/orders.h"
#include "server/http/app/app.h"

namespace isomesh::hospital {

// `orders` is null where no hospital is configured: then the routes answer that. Both must outlive
// the routes.
void add_order_routes(http::App& app, orders::Orders* orders);

}  // namespace isomesh::hospital
