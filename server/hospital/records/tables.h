#pragma once

#include "server/store/sql/schema.h"

namespace isomesh::store {

// The tables of orders, watches, received series and the own worklist.
Schema order_tables();

}  // namespace isomesh::store
