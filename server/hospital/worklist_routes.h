#pragma once

#include <functional>
#include <string>

#include "server/hospital/orders/settings.h"
#include "server/hospital/records/workitem_store.h"
#include "server/http/app/app.h"

namespace isomesh::hospital {

// The routes of the own worklist need these; all must outlive them.
struct OwnWorklist {
  const orders::WorklistSettings& settings;
  store::WorkitemStore& workitems;
  // Cancels the order of this daemon that claimed a workitem with that Transaction UID. Returns
  // false if there is none.
  std::function<bool(const std::string& transaction)> cancel_performing;
};

// UPS-RS (PS3.18, 11) without subscriptions. `worklist` is null if none is configured; the routes
// then respond with that error.
void add_worklist_routes(http::App& app, const OwnWorklist* worklist);

}  // namespace isomesh::hospital
