// Predictions of the networks with their error, as repose.calibrate.surrogates.network_ensemble
// computes them, for one network or several.
"use strict";

// Read a Base64 text of bytes as a typed array.
function unpacked(text, Kind) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Kind(bytes.buffer);
}

function mean(values) {
  return values.reduce((sum, value) => sum + value, 0) / values.length;
}

// Widths of ranges; a range without a width counts as 1.
function widths(low, high) {
  return low.map((value, k) => (high[k] > value ? high[k] - value : 1));
}

// Make a function from a parameter set to {mean, std}, arrays with a number for each response.
// `std` is that of the mean response, without the noise of single runs.
function networkPredictor(model) {
  const predictors = model.members.map((member) => memberPredictor({ ...model, ...member }));
  return function (parameters) {
    const predictions = predictors.map((predict) => predict(parameters));
    const means = predictions[0].mean.map((_, k) => mean(predictions.map((one) => one.mean[k])));
    const stds = means.map((average, k) => {
      const squares = predictions.map((one) => one.std[k] ** 2 + (one.mean[k] - average) ** 2);
      return Math.sqrt(mean(squares));
    });
    return { mean: means, std: stds };
  };
}

// Make such a function of one network.
function memberPredictor(network) {
  const root = unpacked(network.root, Float32Array); // of the covariance of the weights
  const [bottom, top] = network.scaled_range;
  const inputWidths = widths(network.input_min, network.input_max);
  const outputWidths = widths(network.output_min, network.output_max);
  const outputScales = outputWidths.map((width) => width / (top - bottom));
  const hidden = network.b1.length;
  const inputs = inputWidths.length;
  const outputs = network.b2.length;
  const weights = hidden * (inputs + 1) + outputs * (hidden + 1);

  // The derivatives of an output by the weights, in their order: W1, b1, W2, b2.
  function gradientOf(output, x, activations) {
    const gradient = new Float64Array(weights);
    const firstB1 = hidden * inputs;
    const firstW2 = hidden * (inputs + 1);
    const firstB2 = weights - outputs;
    for (let j = 0; j < hidden; j++) {
      const slope = network.W2[output][j] * (1 - activations[j] * activations[j]);
      for (let i = 0; i < inputs; i++) gradient[j * inputs + i] = slope * x[i];
      gradient[firstB1 + j] = slope;
      gradient[firstW2 + output * hidden + j] = activations[j];
    }
    gradient[firstB2 + output] = 1;
    return gradient;
  }

  function varianceOf(gradient) {
    let variance = 0;
    for (let column = 0; column < weights; column++) {
      let sum = 0;
      for (let row = 0; row < weights; row++) sum += gradient[row] * root[row * weights + column];
      variance += sum * sum;
    }
    return variance;
  }

  return function (parameters) {
    const x = parameters.map(
      (value, i) => bottom + ((value - network.input_min[i]) / inputWidths[i]) * (top - bottom));
    const activations = network.b1.map(
      (bias, j) => Math.tanh(x.reduce((sum, value, i) => sum + network.W1[j][i] * value, bias)));
    const means = [];
    const stds = [];
    for (let k = 0; k < outputs; k++) {
      const y = activations.reduce((sum, value, j) => sum + network.W2[k][j] * value, network.b2[k]);
      means.push(network.output_min[k] + (y - bottom) * outputScales[k]);
      stds.push(Math.sqrt(varianceOf(gradientOf(k, x, activations))) * outputScales[k]);
    }
    return { mean: means, std: stds };
  };
}
