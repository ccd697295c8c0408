#pragma once

#include "server/store/received_store.h"
#include "server/store/sql/sql.h"

namespace isomesh::store {

// Received instances in a database, which must outlive this object.
class SqlReceivedStore : public ReceivedStore {
 public:
  explicit SqlReceivedStore(SqlDatabase& database) : database_(database) {}

  std::optional<std::string> add(const ReceivedSeries& series,
                                 const ReceivedInstance& instance) override;
  std::vector<HeldSeries> held() const override;
  std::uint64_t held_bytes() const override;
  std::vector<ReceivedInstance> instances(const ReceivedSeries& series) const override;
  std::vector<std::string> release(const HeldSeries& series) override;
  std::size_t forget(Time before) override;

 private:
  SqlDatabase& database_;
};

}  // namespace isomesh::store
