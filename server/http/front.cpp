#include "server/http/front.h"

#include <utility>

#include <unistd.h>

namespace isomesh::http {

Front::~Front() {
  close(std::chrono::milliseconds(0));
  if (svr_sock_ != INVALID_SOCKET) ::close(svr_sock_);
}

void Front::open(WaitingRoom::HasEnded has_ended) {
  // More than the library asks for: the next ones of a burst would be dropped, and try again a
  // second later.
  ::listen(svr_sock_, SOMAXCONN);
  courier_.emplace(options_.courier);
  tasks_.emplace(options_.threads, options_.backlog);
  waiting_room_.emplace(std::move(has_ended),
                        [this](const std::shared_ptr<Exchange>& exchange) { enqueue(exchange); });
  doorman_.emplace(
      svr_sock_, options_.doorman, options_.stream_of,
      [this](Visitor visitor) { admit(std::move(visitor)); },
      [this](std::unique_ptr<ByteStream> stream, const std::string& address, const Error& error) {
        turn_away(std::move(stream), address, error);
      });
}

void Front::job_ended(const std::string& job) { waiting_room_->ended(job); }

void Front::something_happened() { courier_->wake(); }

void Front::close(std::chrono::milliseconds patience) {
  stopping_ = true;
  if (doorman_) doorman_->stop();
  if (waiting_room_) waiting_room_->close();
  if (tasks_) tasks_->shutdown();
  if (courier_) courier_->stop(patience);
}

void Front::admit(Visitor visitor) {
  enqueue(std::make_shared<Exchange>(std::move(visitor), options_.exchange, stopping_));
}

void Front::turn_away(std::unique_ptr<ByteStream> stream, const std::string& address,
                      const Error& error) {
  if (options_.on_turned_away) options_.on_turned_away(address, error);
  courier_->send({std::move(stream), Exchange::error_answer(error), nullptr});
}

void Front::enqueue(const std::shared_ptr<Exchange>& exchange) {
  if (tasks_->try_enqueue([this, exchange] { serve(exchange); })) return;
  turn_away(exchange->take_stream(), exchange->visitor().address,
            {ErrorCode::kUnavailable, "too many requests are under way"});
}

void Front::serve(const std::shared_ptr<Exchange>& exchange) {
  {
    const Exchange::Serving serving(*exchange);
    bool is_closed = false;
    process_request(*exchange, true, is_closed,
                    [&](httplib::Request& request) { exchange->introduce(request); });
  }
  if (exchange->parking()) {
    waiting_room_->seat(exchange);
  } else {
    exchange->finish(*courier_);
  }
}

}  // namespace isomesh::http
