// Orders as they begin: what a client or a watch asks for, with what its rule says.
#pragma once

#include <string>

#include "server/hospital/orders/hospital.h"
#include "server/hospital/orders/pacs.h"
#include "server/store/order_store.h"

namespace isomesh::orders {

// Whoever orders: a token's name, and whether it may do everything.
struct Orderer {
  std::string name;
  bool is_administrator = false;
};

// The order of a request. Throws Error kInvalidParameter that names what is wrong, kForbidden for
// a rule of another owner, or a PACS whose owners the orderer is none of.
store::OrderRecord make_order(const Hospital& hospital, const Orderer& orderer,
                              const OrderRequest& request);

// The order of a rule for a series that its watch has found, or that was received, in that PACS.
store::OrderRecord make_order(const Rule& rule, const std::string& pacs, const FoundSeries& series);

}  // namespace isomesh::orders
