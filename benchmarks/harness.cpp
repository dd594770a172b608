// Loops that time one algorithm over many states, of pinocchio's library and of a function in C.
#include <chrono>

#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>
#include <pinocchio/serialization.hpp>

namespace {

using Vector = Eigen::VectorXd;
using Input = Eigen::Ref<const Vector>;
using Clock = std::chrono::steady_clock;
using Function = int (*)(const double **, double **, long long *, double *, int);

struct Peer {
  pinocchio::Model model;
  pinocchio::Data data;
  explicit Peer(const pinocchio::Model &m) : model(m), data(m) {}
};

enum Algorithm { IDM, A, DDM, DIDM, DDDM };

void evaluate(Peer &peer, int algorithm, const Input &q, const Input &v, const Input &x) {
  switch (algorithm) {
    case IDM: pinocchio::impl::rnea(peer.model, peer.data, q, v, x); break;
    case A: pinocchio::crba(peer.model, peer.data, q, pinocchio::Convention::LOCAL); break;
    case DDM: pinocchio::aba(peer.model, peer.data, q, v, x, pinocchio::Convention::LOCAL); break;
    case DIDM: pinocchio::impl::computeRNEADerivatives(peer.model, peer.data, q, v, x); break;
    default: pinocchio::impl::computeABADerivatives(peer.model, peer.data, q, v, x);
  }
}

// pinocchio fills the upper triangle of symmetric matrices.
template <class M>
Eigen::MatrixXd symmetric(const M &matrix) {
  const Eigen::MatrixXd full = matrix;
  return full.selfadjointView<Eigen::Upper>();
}

template <class M>
double *copied(const M &matrix, double *out) {
  Eigen::Map<Eigen::MatrixXd>(out, matrix.rows(), matrix.cols()) = matrix;
  return out + matrix.size();
}

double per_call(Clock::time_point start, long calls) {
  return std::chrono::duration<double, std::nano>(Clock::now() - start).count() / calls;
}

}  // namespace

extern "C" {

void *peer_open(const char *file) {
  pinocchio::Model model;
  model.loadFromText(file);
  return new Peer(model);
}

void peer_close(void *handle) { delete static_cast<Peer *>(handle); }

// One evaluation; the result in columns:
// tau | A | a | dtau/dq, dtau/dv, A, tau | da/dq, da/dv, da/dtau, a.
void peer_value(void *handle, int algorithm, const double *q, const double *v, const double *x,
                double *out) {
  Peer &peer = *static_cast<Peer *>(handle);
  const int nq = peer.model.nq, nv = peer.model.nv;
  const Vector qs = Eigen::Map<const Vector>(q, nq), vs = Eigen::Map<const Vector>(v, nv),
               xs = Eigen::Map<const Vector>(x, nv);
  evaluate(peer, algorithm, qs, vs, xs);
  pinocchio::Data &data = peer.data;
  if (algorithm == IDM) copied(data.tau, out);
  if (algorithm == A) copied(symmetric(data.M), out);
  if (algorithm == DDM) copied(data.ddq, out);
  if (algorithm == DIDM)
    copied(data.tau,
           copied(symmetric(data.M), copied(data.dtau_dv, copied(data.dtau_dq, out))));
  if (algorithm == DDDM)
    copied(data.ddq,
           copied(symmetric(data.Minv), copied(data.ddq_dv, copied(data.ddq_dq, out))));
}

// Nanoseconds of one evaluation, mean over `cycles` passes through the states (columns).
double peer_time(void *handle, int algorithm, const double *q, const double *v, const double *x,
                 int states, int cycles) {
  Peer &peer = *static_cast<Peer *>(handle);
  const int nq = peer.model.nq, nv = peer.model.nv;
  const auto start = Clock::now();
  for (int cycle = 0; cycle < cycles; ++cycle)
    for (int k = 0; k < states; ++k)
      evaluate(peer, algorithm, Eigen::Map<const Vector>(q + k * nq, nq),
               Eigen::Map<const Vector>(v + k * nv, nv), Eigen::Map<const Vector>(x + k * nv, nv));
  return per_call(start, static_cast<long>(states) * cycles);
}

// The same of a function in CasADi's calling convention; its inputs are columns of `inputs`.
double function_time(Function function, int count, const double *const *inputs, const int *sizes,
                     double **results, long long *iw, double *w, int states, int cycles) {
  const double *arguments[32];
  const auto start = Clock::now();
  for (int cycle = 0; cycle < cycles; ++cycle)
    for (int k = 0; k < states; ++k) {
      for (int i = 0; i < count; ++i) arguments[i] = inputs[i] + static_cast<long>(k) * sizes[i];
      function(arguments, results, iw, w, 0);
    }
  return per_call(start, static_cast<long>(states) * cycles);
}
}
