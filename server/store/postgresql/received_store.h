#pragma once

#include "server/store/postgresql/database.h"
#include "server/store/received_store.h"

namespace isomesh::store::postgresql {

// Received instances in a database that several processes share, which must outlive it.
class PostgresReceivedStore : public ReceivedStore {
 public:
  explicit PostgresReceivedStore(Database& database) : database_(database) {}

  void add(const ReceivedSeries& series, const ReceivedInstance& instance) override;
  std::vector<HeldSeries> held() const override;
  std::uint64_t held_bytes() const override;
  std::vector<ReceivedInstance> instances(const ReceivedSeries& series) const override;
  std::vector<std::string> release(const HeldSeries& series) override;
  std::size_t forget(Time before) override;

 private:
  Database& database_;
};

}  // namespace isomesh::store::postgresql
