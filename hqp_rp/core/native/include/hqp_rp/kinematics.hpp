// Poses and Jacobians of frames on a kinematic tree, read out of the memory in which a robot library keeps its state.
#pragma once

#include <cstdint>
#include <vector>

namespace hqp {

// What a library computes at each step (poses, joint axes, anchors) stays where it is while its state lives: a step copies nothing and
// calls no library. Whoever makes this keeps that memory alive.
struct Kinematics {
  struct Frame {
    const double* rotation;   // (3, 3) to the world; null: the centre of mass of the moving bodies
    const double* origin;     // (3,)
    std::vector<int> dofs;    // that move it
  };
  struct Dof {
    const double* axis;       // its entries `step` apart
    int step;
    const double* anchor;     // (3,)
    bool turns;               // else it slides
    int body;
    int parent = -1;          // the dof that moves what this one stands on, -1 for none; smaller than its own number
    int carrier = -1;         // the dof with whose motion its axis turns: `parent`, or the last of its own joint; -1 for none
  };
  struct Body {
    int self, parent;
    const double* mass;
    const double* center;     // (3,) of mass
    int dof = -1;             // the nearest that moves it
  };
  std::vector<Frame> frames;
  std::vector<Dof> dofs;
  std::vector<Body> bodies;   // moving ones, leaves first
  double mass = 0.0;          // of all moving bodies
  std::vector<double> carried;  // (number of bodies, 4): moment and mass of a body with all that it carries

  // Rotations (F, 3, 3), origins (F, 3) and world Jacobians (F, 6, n), linear over angular. Column j of a frame with origin p, moved by
  // a dof with axis a and anchor c: [a x (p - c); a] if it turns, [a; 0] if it slides. Entries that are always zero are left as they are.
  void read(double* rotations, double* origins, double* jacobians) {
    const std::size_t n = dofs.size();
    for (std::size_t f = 0; f < frames.size(); ++f) {
      const Frame& frame = frames[f];
      double *R = rotations + 9 * f, *p = origins + 3 * f, *J = jacobians + 6 * n * f;
      if (!frame.rotation) {
        center_of_mass(p, J);
        continue;
      }
      for (int i = 0; i < 9; ++i) R[i] = frame.rotation[i];
      for (int i = 0; i < 3; ++i) p[i] = frame.origin[i];
      for (const int j : frame.dofs) {
        const Dof& dof = dofs[j];
        const double x = dof.axis[0], y = dof.axis[dof.step], z = dof.axis[2 * dof.step];
        if (!dof.turns) {
          J[j] = x, J[n + j] = y, J[2 * n + j] = z;
          continue;
        }
        const double u = p[0] - dof.anchor[0], v = p[1] - dof.anchor[1], w = p[2] - dof.anchor[2];
        J[j] = y * w - z * v, J[n + j] = z * u - x * w, J[2 * n + j] = x * v - y * u;
        J[3 * n + j] = x, J[4 * n + j] = y, J[5 * n + j] = z;
      }
    }
  }

  // Twists J v (F, 6) and bias accelerations Jdot v (F, 6) for v (n,). With S_j = [a; c x a] (it turns) or [0; a] (it slides), angular
  // over linear at the world's origin, V_j = V_parent + S_j v_j and A_j = A_parent + V_carrier x S_j v_j (Featherstone 2008, (2.31)); the
  // acceleration of a frame's origin p is then a_0 + alpha x p + omega x (v_0 + omega x p).
  void motion(const double* v, double* twists, double* biases) {
    const std::size_t n = dofs.size();
    spatial.assign(12 * n, 0.0);
    auto above = [&](int j) { return j < 0 ? zero : &spatial[12 * static_cast<std::size_t>(j)]; };
    for (std::size_t j = 0; j < n; ++j) {
      double S[6], *V = &spatial[12 * j];
      subspace(dofs[j], S);
      const double* before = above(dofs[j].parent);
      for (int k = 0; k < 6; ++k) V[k] = before[k] + S[k] * v[j];
    }
    for (std::size_t j = 0; j < n; ++j) {
      double S[6], turned[6], *A = &spatial[12 * j + 6];
      subspace(dofs[j], S);
      const double* V = above(dofs[j].carrier);
      cross(V, S, turned);
      cross(V, S + 3, turned + 3);
      double more[3];
      cross(V + 3, S, more);
      const double* before = above(dofs[j].parent) + 6;
      for (int k = 0; k < 3; ++k) {
        A[k] = before[k] + turned[k] * v[j];
        A[3 + k] = before[3 + k] + (turned[3 + k] + more[k]) * v[j];
      }
    }
    for (std::size_t f = 0; f < frames.size(); ++f) {
      double *twist = twists + 6 * f, *bias = biases + 6 * f;
      for (int k = 0; k < 6; ++k) twist[k] = bias[k] = 0.0;
      if (!frames[f].rotation) {
        for (const Body& body : bodies) {
          double velocity[3], acceleration[3];
          at_point(above(body.dof), body.center, velocity, acceleration);
          for (int k = 0; k < 3; ++k) {
            twist[k] += *body.mass / mass * velocity[k];
            bias[k] += *body.mass / mass * acceleration[k];
          }
        }
        continue;
      }
      const double* V = above(frames[f].dofs.empty() ? -1 : frames[f].dofs.front());
      at_point(V, frames[f].origin, twist, bias);
      for (int k = 0; k < 3; ++k) twist[3 + k] = V[k], bias[3 + k] = V[6 + k];
    }
  }

  // Centre of mass c (3,) and the linear half of J (6, n). With the mass m_j and the centre c_j of all that dof j carries:
  // J_j = m_j / m a x (c_j - anchor) if it turns, m_j / m a if it slides.
  void center_of_mass(double* c, double* J) {
    const std::size_t n = dofs.size();
    for (double& v : carried) v = 0.0;
    c[0] = c[1] = c[2] = 0.0;
    for (const Body& body : bodies) {  // leaves first: a body is complete when its parent takes it
      double *own = &carried[4 * body.self], *parent = &carried[4 * body.parent];
      own[3] += *body.mass;
      parent[3] += own[3];
      for (int k = 0; k < 3; ++k) {
        const double moment = *body.mass * body.center[k];
        own[k] += moment;
        parent[k] += own[k];
        c[k] += moment / mass;
      }
    }
    for (std::size_t j = 0; j < n; ++j) {
      const Dof& dof = dofs[j];
      const double x = dof.axis[0] / mass, y = dof.axis[dof.step] / mass, z = dof.axis[2 * dof.step] / mass;
      const double* own = &carried[4 * dof.body];
      if (!dof.turns) {
        J[j] = own[3] * x, J[n + j] = own[3] * y, J[2 * n + j] = own[3] * z;
        continue;
      }
      const double u = own[0] - own[3] * dof.anchor[0], v = own[1] - own[3] * dof.anchor[1], w = own[2] - own[3] * dof.anchor[2];
      J[j] = y * w - z * v, J[n + j] = z * u - x * w, J[2 * n + j] = x * v - y * u;
    }
  }

 private:
  std::vector<double> spatial;  // (n, 12): V_j and A_j, angular over linear at the world's origin
  static constexpr double zero[12] = {};

  static void cross(const double* a, const double* b, double* out) {
    out[0] = a[1] * b[2] - a[2] * b[1], out[1] = a[2] * b[0] - a[0] * b[2], out[2] = a[0] * b[1] - a[1] * b[0];
  }

  static void subspace(const Dof& dof, double* S) {
    const double axis[3] = {dof.axis[0], dof.axis[dof.step], dof.axis[2 * dof.step]};
    for (int k = 0; k < 3; ++k) S[k] = dof.turns ? axis[k] : 0.0, S[3 + k] = axis[k];
    if (dof.turns) cross(dof.anchor, axis, S + 3);
  }

  // Velocity and acceleration of the point p of a body with V and A (12).
  static void at_point(const double* V, const double* p, double* velocity, double* acceleration) {
    double turning[3], swing[3], pull[3];
    cross(V, p, turning);
    for (int k = 0; k < 3; ++k) velocity[k] = V[3 + k] + turning[k];
    cross(V + 6, p, swing);
    cross(V, velocity, pull);
    for (int k = 0; k < 3; ++k) acceleration[k] = V[9 + k] + swing[k] + pull[k];
  }
};

}  // namespace hqp
