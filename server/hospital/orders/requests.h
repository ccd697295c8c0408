// Makes orders from requests and rules.
#pragma once

#include <string>

#include "server/hospital/orders/pacs.h"
#include "server/hospital/orders/settings.h"
#include "server/hospital/records/order_store.h"

namespace isomesh::orders {

// The sender of an order: a token's name, and whether it is an administrator.
struct Orderer {
  std::string name;
  bool is_administrator = false;
};

// Makes the order of a request. Throws Error kInvalidParameter that names the field; kForbidden for
// another owner's rule, or a PACS that excludes the orderer.
store::OrderRecord make_order(const HospitalSettings& settings, const Orderer& orderer,
                              const OrderRequest& request);

// Throws Error kNotFound if there is no such PACS, kInvalidParameter if it cannot be searched, and
// kForbidden if it excludes that person.
void check_searchable(const HospitalSettings& settings, const Orderer& person,
                      const std::string& pacs);

// Makes the order of a rule for a series that its watch has found or that was received.
store::OrderRecord make_order(const Rule& rule, const std::string& pacs, const FoundSeries& series);

}  // namespace isomesh::orders
