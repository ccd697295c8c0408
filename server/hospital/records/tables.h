#pragma once

#include "server/store/sql/schema.h"

namespace isomesh::store {

// The tables of orders, watches and received series.
Schema order_tables();

}  // namespace isomesh::store
